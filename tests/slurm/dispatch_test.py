"""gonio dispatch on a real Slurm whose nodes, controller and queue fail: the table has the bits of `gonio run` every time.

Usage: dispatch_test.py PROGRAM [TEST...]
"""
import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from cluster import Cluster, wait_until

PROGRAM = ""
# Clusters that run. unittest leaves out its clean-ups on Ctrl-C, this does not.
EVERYTHING = contextlib.ExitStack()

JOB = """{"surface": {"generate": "gaussian", "samples": 48, "pitch": "10 um", "correlation_length": "15 um", "rms_slope": 1.5},
 "material": {"model": "lambertian", "albedo": 0.8},
 "measure": {"kind": "brdf", "incident": {"hemisphere": 8}, "outgoing": {"hemisphere": 8}},
 "accuracy": {"target_relative_error": 0.01}}"""

# Shards wait for a gate, so that what is done to them is done in their middle on every machine.
GATED = """#!/bin/sh
while [ "$1" = shard ] && [ ! -e {gate} ]; do sleep 0.1; done
exec {program} "$@"
"""
# The submissions of a job, counted on their way.
COUNTED = """#!/bin/sh
case "$*" in *--array*) echo "$*" >> {log} ;; esac
exec {sbatch} "$@"
"""


class DispatchTest(unittest.TestCase):
    def setUp(self) -> None:
        # Short and readable to all: munge's socket lies in it.
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio-slurm-"))
        self.folder.chmod(0o755)
        stack = EVERYTHING.enter_context(contextlib.ExitStack())
        self.addCleanup(stack.close)
        stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
        self.cluster = stack.enter_context(Cluster(self.folder))
        (self.folder / "job.json").write_text(JOB, encoding="utf-8")
        subprocess.run([PROGRAM, "run", "job.json", "-q", "-o", "expected"], cwd=self.folder, check=True, timeout=600)
        self.gate = self.folder / "gate"
        self.script("gated", GATED.format(gate=self.gate, program=PROGRAM))
        self.script("sbatch", COUNTED.format(log=self.submissions(), sbatch=shutil.which("sbatch")))
        self.cluster.environment["PATH"] = f"{self.folder}:{self.cluster.environment['PATH']}"

    def script(self, name: str, text: str) -> None:
        (self.folder / name).write_text(text, encoding="utf-8")
        (self.folder / name).chmod(0o755)

    def submissions(self) -> pathlib.Path:
        return self.folder / "submissions"

    def n_submissions(self) -> int:
        return len(self.submissions().read_text(encoding="utf-8").splitlines())

    def start(self) -> "subprocess.Popen[str]":
        """Dispatches the job."""
        shutil.rmtree(self.folder / "out", ignore_errors=True)
        process = subprocess.Popen([PROGRAM, "dispatch", "job.json", "--executor", "slurm", "--checkpoints", "shared", "-o", "out",
                                    "--program", str(self.folder / "gated")], cwd=self.folder, env=self.cluster.environment,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(process.__exit__, None, None, None)
        self.addCleanup(process.kill)
        return process

    def running(self) -> list[dict[str, str]]:
        """Tasks of the job, once four of them wait at the gate."""
        def four() -> list[dict[str, str]]:
            tasks = [task for task in self.cluster.tasks() if task["name"].startswith("gonio-")]
            return tasks if sum(task["state"] == "RUNNING" for task in tasks) == 4 else []
        return wait_until("four shards run", four)

    def expect_same_table(self, process: "subprocess.Popen[str]") -> None:
        output, _ = process.communicate(timeout=600)
        self.assertEqual(process.returncode, 0, output)
        self.assertEqual((self.folder / "out/job.csv").read_bytes(), (self.folder / "expected/job.csv").read_bytes())
        self.assertEqual(os.listdir(self.folder / "shared"), [], "what nobody needs any more is removed")

    def test_plain(self) -> None:
        self.gate.touch()
        self.expect_same_table(self.start())

    def test_node_dies(self) -> None:
        process = self.start()
        self.running()
        self.cluster.kill_node("v2")
        self.gate.touch()
        self.expect_same_table(process)

    def test_controller_forgets_what_it_accepted(self) -> None:
        """Killed before its state is on the disk: jobs vanish, and their numbers are given to others."""
        before = self.folder / "state-before"
        self.cluster.kill("slurmctld")
        shutil.copytree(self.folder / "state", before)
        self.cluster.start_controller()
        process = self.start()
        number = self.running()[0]["array_job_id"]
        self.cluster.kill("slurmctld")
        shutil.rmtree(self.folder / "state")
        shutil.copytree(before, self.folder / "state")
        self.cluster.start_controller()
        other = self.cluster.ask("sbatch", "--parsable", "--job-name=other", "--array=1-2", f"--chdir={self.folder}", "--output=/dev/null",
                                 "--wrap=true", "--begin=now+1hour").stdout.strip()
        self.assertEqual(other, number, "Slurm gives the number again")
        self.gate.touch()
        self.expect_same_table(process)
        self.assertGreaterEqual(self.n_submissions(), 2)
        self.assertEqual([task["array_job_id"] for task in self.cluster.tasks()], [other, other], "a stranger's tasks are left alone")

    def test_stranger_cancels_the_array(self) -> None:
        process = self.start()
        number = self.running()[0]["array_job_id"]
        self.cluster.ask("scancel", number)
        wait_until("the array is gone", lambda: all(task["array_job_id"] != number for task in self.cluster.tasks()))
        self.gate.touch()
        self.expect_same_table(process)
        self.assertGreaterEqual(self.n_submissions(), 2)

    def test_requeued_task(self) -> None:
        process = self.start()
        task = next(task for task in self.running() if task["state"] == "RUNNING")
        answer = self.cluster.ask("scontrol", "requeue", f"{task['array_job_id']}_{task['array_task_id']}")
        self.assertEqual(answer.returncode, 0, answer.stderr)
        before = self.n_submissions()
        wait_until("it runs again", lambda: sum(task["state"] == "RUNNING" for task in self.cluster.tasks()) == 4)
        self.assertEqual(self.n_submissions(), before, "a task that Slurm runs again is not submitted again")
        self.gate.touch()
        self.expect_same_table(process)

    def test_interrupted_dispatch_cancels_and_goes_on(self) -> None:
        process = self.start()
        self.running()
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130)
        wait_until("no shard is left", lambda: not self.cluster.tasks())
        self.gate.touch()
        self.expect_same_table(self.start())

    def test_killed_dispatch_finds_its_shards_again(self) -> None:
        process = self.start()
        self.running()
        process.kill()
        process.communicate()
        before = self.n_submissions()
        again = self.start()
        time.sleep(12)  # two polls; that it submits nothing is checked, not how soon
        self.assertEqual(self.n_submissions(), before)
        self.gate.touch()
        self.expect_same_table(again)


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    for index, name in enumerate(sys.argv[1:], 1):
        sys.argv[index] = f"DispatchTest.{name}"
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with EVERYTHING:
        unittest.main(verbosity=2)
