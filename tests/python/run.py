#!/usr/bin/env python3
"""Builds the wheel of clients/python, installs it into a fresh environment, and runs the tests here against it.

Usage: run.py GONIO [unittest options]. Nothing is downloaded, and the source folder stays as it is.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
CLIENT = HERE.parents[1] / "clients/python"


def main() -> int:
    gonio, *options = sys.argv[1:]
    with tempfile.TemporaryDirectory(prefix="gonio_python_") as name:
        folder = pathlib.Path(name)
        shutil.copytree(CLIENT, folder / "source")
        environment = folder / "environment"
        venv = [sys.executable, "-m", "venv", "--system-site-packages", "--without-pip"]
        subprocess.run([*venv, environment], check=True)
        python = environment / "bin/python"
        pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "--no-input"]
        subprocess.run([*pip, "wheel", "--no-build-isolation", "--no-index", "--no-deps", "-w", folder,
                        folder / "source"], check=True)
        [wheel] = folder.glob("*.whl")
        subprocess.run([*pip, "--python", python, "install", "--no-index", wheel], check=True)
        where = subprocess.check_output([python, "-c", "import gonio; print(gonio.__file__)"], cwd=folder, text=True)
        if not where.startswith(str(environment.resolve())):
            raise SystemExit(f"not the installed wheel: {where}")
        command = [python, "-m", "unittest", "discover", "-s", HERE, "-p", "*_test.py", *options]
        return subprocess.run(command, cwd=folder, env={**os.environ, "GONIO": os.path.abspath(gonio),
                                                        "PYTHONDONTWRITEBYTECODE": "1"}).returncode


if __name__ == "__main__":
    sys.exit(main())
