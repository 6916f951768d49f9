"""A running `gonio serve` for the tests of the service, and the jobs that they send.

The programs that import this are called with GONIO SOURCE_FOLDER [unittest options].
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from daemon import Daemon

GONIO = os.path.abspath(sys.argv.pop(1))
SOURCE = pathlib.Path(sys.argv.pop(1)).resolve()
LAVA = SOURCE / "tests/samples/lava_rock_256_16bit.png"

DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}
MEASURE = {"kind": "brdf", "incident": DIRECTIONS, "outgoing": {"theta_deg": [0, 30], "phi_deg": [0, 180]}}
GROOVE = {"generate": "v_groove", "samples": 16, "period": "1mm", "slope_deg": 45}
LAMBERTIAN = {"model": "lambertian", "albedo": 0.5}
JOB = {"surface": GROOVE, "material": LAMBERTIAN, "measure": MEASURE}
# Minutes of work.
LONG = {"surface": {"generate": "gaussian", "samples": 512, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 1},
        "material": LAMBERTIAN, "measure": MEASURE | {"incident": {"klems": "full"}, "outgoing": {"klems": "full"}},
        "accuracy": {"target_relative_error": 1e-4}}
# Minutes of work, in runs of milliseconds.
MANY_RUNS = {"surface": {"generate": "gaussian", "samples": 24, "pitch": "1 um", "correlation_length": "3 um", "rms_slope": 1},
             "material": LAMBERTIAN, "measure": MEASURE, "accuracy": {"samples": {"directions": 1024, "replicates": 4096}}}
# Some seconds, in several runs.
MEDIUM = {"surface": {"generate": "gaussian", "samples": 96, "pitch": "1 um", "correlation_length": "3 um", "rms_slope": 1},
          "material": LAMBERTIAN, "measure": MEASURE | {"incident": {"hemisphere": 64}, "outgoing": {"hemisphere": 64}},
          "accuracy": {"target_relative_error": 0.003}}


class Service(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_serve_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.daemon = Daemon(GONIO, self.folder / "data")
        self.daemon.start()
        self.addCleanup(self.kill)

    def start(self, *options):
        self.daemon.start(*options)

    def kill(self):
        self.daemon.kill()

    def restart(self, *options):
        self.kill()
        self.start(*options)

    @property
    def url(self):
        return self.daemon.url

    def call(self, method, path, body=None, **headers):
        status, self.headers, answer = self.daemon.ask(method, path, body, **headers)
        return status, answer

    def submit(self, inputs, process="brdf", **headers):
        status, info = self.call("POST", f"/processes/{process}/execution", {"inputs": inputs}, **headers)
        self.assertEqual(status, 201, info)
        return info

    def wait(self, job, seconds=120):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            status, info = self.call("GET", f"/jobs/{job}")
            self.assertEqual(status, 200)
            if info["status"] not in ("accepted", "running"):
                return info
            time.sleep(0.05)
        self.fail(f"still {info}")

    def table(self, job, name="csv"):
        status, data = self.call("GET", f"/jobs/{job}/results/table?f={name}")
        self.assertEqual(status, 200, data)
        return data

    def local(self, inputs):
        """The bytes of `gonio run` for the same job."""
        (self.folder / "job.json").write_text(json.dumps(inputs | {"output": [{"format": "csv", "path": "local.csv"}]}))
        subprocess.run([GONIO, "run", "job.json", "-q", "--threads", "2"], cwd=self.folder, check=True)
        return (self.folder / "local.csv").read_bytes()
