#!/usr/bin/env python3
"""The command line against a service: the same job, the same bytes.

Usage: remote_cli_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import shutil
import subprocess
import unittest

from service_fixture import GONIO, JOB, LAVA, LONG, MEDIUM, Service


class Remote(Service):
    def gonio(self, *arguments, code=0):
        done = subprocess.run([GONIO, *map(str, arguments)], cwd=self.folder, capture_output=True, text=True, timeout=300)
        self.assertEqual(done.returncode, code, done.stderr)
        return done

    def write(self, job, outputs):
        (self.folder / "job.json").write_text(json.dumps({**job, "output": outputs}))

    def test_run_writes_the_same_files(self):
        shutil.copy(LAVA, self.folder / "lava.png")
        job = {**JOB, "surface": {"file": "lava.png", "width": "50mm", "height_range": "5mm", "resample": [64, 64]},
               "material": {"model": "lambertian", "albedo": {"file": "map.png"}}}
        shutil.copy(LAVA, self.folder / "map.png")
        self.write(job, [{"format": "csv", "path": "sub/a.csv"}, {"format": "exr", "path": "a.exr"}, {"format": "json", "path": "a.json"}])
        self.gonio("run", "job.json", "-o", "local")
        done = self.gonio("run", "job.json", "-o", "remote", "--server", self.url, "--json")
        self.assertEqual(json.loads(done.stdout)["status"], "done")
        for name in ("sub/a.csv", "a.json"):
            self.assertEqual((self.folder / "local" / name).read_bytes(), (self.folder / "remote" / name).read_bytes())
        self.assertEqual((self.folder / "local/a.exr").stat().st_size, (self.folder / "remote/a.exr").stat().st_size)

    def test_run_writes_the_same_pictures(self):
        lights = {"list_deg": [[30, 0], [60, 90]]}
        btf, matte, glossy = {"kind": "btf", "incident": lights, "outgoing": lights}, JOB["material"], {"model": "ggx", "alpha": 0.4, "metal": "Al"}
        for material, measure, formats in ((matte, btf, ("btf", "images", "npy", "png", "csv")), (glossy, btf, ("images", "npy", "png", "csv")),
                                           (glossy, {**btf, "kind": "light_field"}, ("images", "npy", "png")),
                                           (matte, {"kind": "maps", "incident": lights}, ("arrays", "png")),
                                           (glossy, {"kind": "maps", "incident": lights}, ("arrays", "npy"))):
            self.write({**JOB, "material": material, "measure": measure, "accuracy": {"samples": {"directions": 16, "replicates": 2}}}, [{"format": name, "path": f"a.{name}"} for name in formats])
            self.gonio("run", "job.json", "-o", "local", "-q")
            self.gonio("run", "job.json", "-o", "remote", "-q", "--server", self.url)
            for name in formats:
                self.assertEqual((self.folder / f"local/a.{name}").read_bytes(), (self.folder / f"remote/a.{name}").read_bytes())

    def test_run_takes_the_environment_along(self):
        (self.folder / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" + bytes(range(96, 128)) * 4)
        self.write({**JOB, "environment": {"file": "sky.hdr"}, "measure": {"kind": "relight", "outgoing": {"list_deg": [[30, 0]]}}},
                   [{"format": "csv", "path": "a.csv"}])
        self.gonio("run", "job.json", "-o", "local", "-q")
        self.gonio("run", "job.json", "-o", "remote", "-q", "--server", self.url)
        self.assertEqual((self.folder / "local/a.csv").read_bytes(), (self.folder / "remote/a.csv").read_bytes())

    def test_submit_wait_fetch_list(self):
        self.write(MEDIUM, [{"format": "csv", "path": "a.csv"}])
        job = self.gonio("submit", "job.json", "--server", self.url).stdout.strip()
        self.assertIn(job, self.gonio("status", job, "--server", self.url).stdout)
        self.assertIn("successful", self.gonio("wait", job, "--server", self.url).stdout)
        path = self.gonio("fetch", job, "--server", self.url, "-o", "got").stdout.strip()
        self.gonio("run", "job.json", "-q")
        self.assertEqual((self.folder / path).read_bytes(), (self.folder / "a.csv").read_bytes())
        self.assertIn(job, self.gonio("list", "--server", self.url).stdout)
        listed = json.loads(self.gonio("list", "--server", self.url, "--json").stdout)
        self.assertEqual([entry["jobID"] for entry in listed["jobs"]], [job])

    def test_cancel(self):
        self.write(LONG, [])
        (self.folder / "job.json").write_text(json.dumps(LONG))
        job = self.gonio("submit", "job.json", "--server", self.url).stdout.strip()
        self.assertIn("dismissed", self.gonio("cancel", job, "--server", self.url).stdout)
        self.assertIn("dismissed", self.gonio("wait", job, "--server", self.url, code=5).stdout)

    def test_refusals_name_the_field(self):
        self.write({**JOB, "material": {"model": "lambertian", "albedo": 2}}, [])
        self.assertIn("/material/albedo", self.gonio("submit", "job.json", "--server", self.url, code=3).stderr)
        self.assertIn("there is no job", self.gonio("status", "0" * 32, "--server", self.url, code=3).stderr)
        self.restart("--max-table-bytes", "10")
        (self.folder / "job.json").write_text(json.dumps(JOB))
        self.assertIn("/measure", self.gonio("submit", "job.json", "--server", self.url, code=6).stderr)
        self.gonio("status", "x", "--server", "example", code=2)

    def test_service_that_restarts(self):
        (self.folder / "job.json").write_text(json.dumps(MEDIUM))
        self.write(MEDIUM, [{"format": "csv", "path": "a.csv"}])
        self.kill()
        port = self.daemon.port
        client = subprocess.Popen([GONIO, "run", "job.json", "-o", "remote", "-q", "--server", f"http://127.0.0.1:{port}"],
                                  cwd=self.folder)  # nobody there yet
        self.addCleanup(client.wait)
        self.addCleanup(client.kill)
        self.daemon.start(port=port)
        self.assertEqual(client.wait(120), 0)
        self.gonio("run", "job.json", "-o", "local", "-q")
        self.assertEqual((self.folder / "local/a.csv").read_bytes(), (self.folder / "remote/a.csv").read_bytes())


if __name__ == "__main__":
    unittest.main()
