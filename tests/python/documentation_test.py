"""The examples in docstrings and in the README run, and the types hold."""
import doctest
import importlib
import pathlib
import pkgutil
import subprocess
import sys

import gonio
import numpy as np
from support import GONIO, MATERIAL, MEASURE, ROOT, SURFACE, ServiceTest


class Documentation(ServiceTest):
    def test_docstrings(self):
        client = gonio.Client(self.service.url)
        names = {"gonio": gonio, "np": np, "url": self.service.url, "client": client, "program": GONIO,
                 "surface": SURFACE, "material": MATERIAL, "measure": MEASURE,
                 "table": client.run(surface=SURFACE, material=MATERIAL, measure=MEASURE)}
        attempted = 0
        for module in pkgutil.iter_modules(gonio.__path__, "gonio."):
            result = doctest.testmod(importlib.import_module(module.name), extraglobs=names)
            self.assertEqual(result.failed, 0, module.name)
            attempted += result.attempted
        self.assertGreaterEqual(attempted, 8)

    def test_readme(self):
        text = (ROOT / "clients/python/README.md").read_text()
        text = text.replace("http://127.0.0.1:8080", self.service.url).replace('program="gonio"', f"program={GONIO!r}")
        text = text.replace('"lava.csv"', repr(str(self.folder / "lava.csv")))
        text = text.replace('"results"', repr(str(self.folder / "results")))
        text = text.replace('"lava.png"', repr(str(ROOT / "tests/samples/lava_rock_256_16bit.png")))
        examples = doctest.DocTestParser().get_doctest(text.replace("```", ""), {}, "README.md", None, 0)
        self.assertGreaterEqual(len(examples.examples), 10)
        self.assertEqual(doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(examples).failed, 0)

    def test_types(self):
        self.assertTrue((pathlib.Path(gonio.__file__).parent / "py.typed").exists())
        command = ["/usr/bin/mypy", "--python-executable", sys.executable, "--cache-dir", str(self.folder)]
        result = subprocess.run(command, cwd=ROOT / "clients/python", capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
