#!/usr/bin/env python3
"""gonio dispatch with processes of this machine and with command templates: the bytes of `gonio run`, also after kills.

Usage: dispatch_test.py PROGRAM SOURCE_FOLDER     (Slurm: tests/slurm/run)
"""
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, SOURCES = "", pathlib.Path()

JOB = """{"surface": {"file": "heights.txt", "pitch": "10 um", "height_scale": "10 um"},
 "material": {"model": "lambertian", "albedo": 0.8},
 "measure": {"kind": "brdf", "incident": {"hemisphere": 4}, "outgoing": {"hemisphere": 4}},
 "accuracy": {"samples": {"replicates": 4, "directions": 16}}}"""
HEIGHTS = "\n".join(" ".join(str((7 * x * x + 3 * x * y + 5 * y) % 11) for x in range(16)) for y in range(16))
# Shards wait for a gate, so that what is done to them is done in their middle on every machine.
GATED = """#!/bin/sh
if [ "$1" = shard ]; then
    echo $$ >> {folder}/started
    while [ ! -e {folder}/gate ]; do [ -d {folder} ] || exit 1; sleep 0.1; done
fi
exec {program} "$@"
"""


class DispatchTest(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory(prefix="gonio-dispatch-")))
        (self.folder / "job").mkdir()
        (self.folder / "job/job.json").write_text(JOB, encoding="utf-8")
        (self.folder / "job/heights.txt").write_text(HEIGHTS, encoding="utf-8")
        self.script("gated", GATED.format(folder=self.folder, program=PROGRAM))
        subprocess.run([PROGRAM, "run", "job/job.json", "-q", "-o", "expected"], cwd=self.folder, check=True, timeout=600)

    def script(self, name: str, text: str) -> None:
        (self.folder / name).write_text(text, encoding="utf-8")
        (self.folder / name).chmod(0o755)

    def start(self, *options: str, program: str = "gated") -> "subprocess.Popen[str]":
        process = subprocess.Popen([PROGRAM, "dispatch", "job/job.json", "--checkpoints", "shared", "-o", "out", "--program", str(self.folder / program),
                                    "--at-once", "2", *options], cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   env=dict(os.environ, PATH=f"{self.folder}:{os.environ['PATH']}"))
        self.addCleanup(process.__exit__, None, None, None)
        self.addCleanup(process.kill)
        return process

    def open_gate(self) -> None:
        (self.folder / "gate").touch()

    def started(self) -> list[int]:
        """Processes of the shards, once two of them wait at the gate."""
        end = time.monotonic() + 120
        pids: list[int] = []
        while len(pids) < 2:
            self.assertLess(time.monotonic(), end, "no shard was started")
            time.sleep(0.05)
            if (self.folder / "started").exists():
                pids = [int(line) for line in (self.folder / "started").read_text().splitlines()]
        return pids

    def expect_same_table(self, process: "subprocess.Popen[str]") -> None:
        output, _ = process.communicate(timeout=600)
        self.assertEqual(process.returncode, 0, output)
        self.assertEqual((self.folder / "out/job.csv").read_bytes(), (self.folder / "expected/job.csv").read_bytes())
        self.assertEqual(os.listdir(self.folder / "shared"), [], "what nobody needs any more is removed")

    def expect_interrupted_then_resumed(self, *options: str) -> None:
        process = self.start(*options)
        pids = self.started()
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130, output)
        end = time.monotonic() + 60
        while any(command_line(pid) for pid in pids):
            self.assertLess(time.monotonic(), end, "shards go on after Ctrl-C")
            time.sleep(0.05)
        self.open_gate()
        self.expect_same_table(self.start(*options))

    def test_local(self) -> None:
        self.open_gate()
        self.expect_same_table(self.start())

    def test_local_interrupted(self) -> None:
        self.expect_interrupted_then_resumed()

    def test_local_killed(self) -> None:
        """Its shards go on; whoever comes after may compute the same ones at the same time."""
        process = self.start()
        self.started()
        process.kill()
        process.communicate()
        again = self.start()
        self.open_gate()
        self.expect_same_table(again)

    def test_gnu_parallel(self) -> None:
        self.open_gate()
        self.expect_same_table(self.start("--executor", str(SOURCES / "deploy/executors/gnu_parallel.json")))

    def test_gnu_parallel_interrupted(self) -> None:
        self.expect_interrupted_then_resumed("--executor", str(SOURCES / "deploy/executors/gnu_parallel.json"))

    def test_kubernetes_manifest_is_filled_in(self) -> None:
        """Only what kubectl gets to see: tests/kubernetes/run validates the manifest itself."""
        self.script("kubectl", f'#!/bin/sh\ncase "$1" in apply) cat > {self.folder}/applied ;; get) [ ! -e {self.folder}/applied ] ;; esac')
        process = self.start("--executor", str(SOURCES / "deploy/executors/kubernetes.json"))
        end = time.monotonic() + 120
        while not (self.folder / "applied").exists() or not (text := (self.folder / "applied").read_text()).endswith("]\n"):
            self.assertLess(time.monotonic(), end)
            self.assertIsNone(process.poll())
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
        (shared,) = (self.folder / "shared").iterdir()
        name = f"gonio-{shared.name[:12]}"
        lines = {line.strip() for line in text.splitlines()}
        for line in (f"name: {name}-1", f"labels: {{gonio: {name}}}", "completions: 4", f"- {{name: GONIO_RUN, value: {shared}/dispatch/run}}",
                     f"- {{name: GONIO_LIST, value: {shared}/dispatch/submission-1}}"):
            self.assertIn(line, lines)

    def test_a_job_that_cannot_be_done(self) -> None:
        """What no other machine would change ends the job at once, with what the shard said."""
        self.open_gate()
        self.script("refuses", "#!/bin/sh\necho 'gonio: error: no room' >&2; exit 6")
        process = self.start(program="refuses")
        output, _ = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 6, output)
        self.assertIn("no room", output)
        self.assertFalse((self.folder / "out").exists(), "no partial file")


def command_line(pid: int) -> bytes:
    """Empty if there is no such process, also for a zombie."""
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


if __name__ == "__main__":
    PROGRAM, SOURCES = os.path.abspath(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
