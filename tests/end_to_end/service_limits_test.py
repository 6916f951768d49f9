#!/usr/bin/env python3
"""What the service refuses and to whom, and what an operator sees of it.

Usage: service_limits_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import hashlib
import json
import pathlib
import re
import struct
import subprocess
import time
import unittest

from exr_file import exr
from service_fixture import GONIO, GROOVE, JOB, LONG, MEASURE, Service

PROGRAM = pathlib.Path(GONIO).read_bytes()
not_sanitized = unittest.skipIf(b"__tsan_init" in PROGRAM or b"__asan_init" in PROGRAM, "a sanitizer needs what the decoding process may not do")
ALICE, BOB = "alice-0123456789abcdef", "bob-0123456789abcdef"


class Limits(Service):
    def put(self, data):
        digest = hashlib.sha256(data).hexdigest()
        self.assertIn(self.call("PUT", f"/surfaces/{digest}", data)[0], (200, 201))
        return digest

    def refused(self, inputs, status, pointer, process="brdf"):
        code, problem = self.call("POST", f"/processes/{process}/execution", {"inputs": inputs})
        self.assertEqual(code, status, problem)
        self.assertEqual(problem["errors"][0]["pointer"], pointer)
        return problem["errors"][0]["detail"]

    def test_too_large_says_what_would_fit(self):
        self.restart("--max-job-seconds", "2", "--max-table-bytes", "100000")
        detail = self.refused({**LONG, "measure": MEASURE}, 422, "/inputs/accuracy")
        target = float(re.search(r"target_relative_error of (\S+) would fit", detail).group(1))
        status, info = self.call("POST", "/processes/brdf/execution",
                                 {"inputs": {**LONG, "measure": MEASURE, "accuracy": {"target_relative_error": target}}})
        self.assertEqual(status, 201, info)
        self.call("DELETE", f"/jobs/{info['jobID']}")  # two seconds are short on a busy machine
        self.assertIn("would fit", self.refused({**JOB, "measure": LONG["measure"]}, 422, "/inputs/measure"))
        self.restart("--max-job-bytes", "70000000")
        self.assertIn("resample", self.refused({**JOB, "surface": LONG["surface"]}, 422, "/inputs/surface"))

    def test_job_is_stopped_after_its_time(self):
        # Predicted by its budget, which is a wish: the limit is what ends it.
        job = {**LONG, "accuracy": {"max_seconds": 0.9, "target_relative_error": 1e-6}}
        self.restart("--max-job-seconds", "1")
        slow = {**job, "surface": {**LONG["surface"], "samples": 2048}}
        info = self.wait(self.submit(slow)["jobID"])
        if info["status"] == "failed":
            self.assertIn("1 s that this service allows", info["message"])
            self.assertEqual(self.call("GET", f"/jobs/{info['jobID']}/results")[0], 422)
        else:  # a machine that is done in time
            self.assertEqual(info["status"], "successful")

    def test_quotas_answer_429(self):
        tokens = self.folder / "tokens"
        tokens.write_text(f"alice {ALICE}\nbob {BOB}\n")
        tokens.chmod(0o600)
        self.restart("--token-file", str(tokens), "--max-jobs-per-token", "2", "--max-queue", "2")
        jobs = []
        for seed in (1, 2):
            status, info = self.call("POST", "/processes/brdf/execution",
                                     {"inputs": {**LONG, "accuracy": {"target_relative_error": 1e-4, "seed": seed}}},
                                     Authorization=f"Bearer {ALICE}")
            self.assertEqual(status, 201, info)
            jobs.append(info["jobID"])
        body = {"inputs": JOB}
        status, problem = self.call("POST", "/processes/brdf/execution", body, Authorization=f"Bearer {ALICE}")
        self.assertEqual((status, "unfinished" in problem["detail"]), (429, True), problem)
        self.assertGreaterEqual(int(self.headers["Retry-After"]), 1)
        # Another token has its own quota; one of alice's jobs runs, so that there is room in the queue.
        status, info = self.call("POST", "/processes/brdf/execution", body, Authorization=f"Bearer {BOB}")
        self.assertEqual(status, 201, info)
        for job in jobs:
            self.assertEqual(self.call("DELETE", f"/jobs/{job}", Authorization=f"Bearer {ALICE}")[0], 200)

    def test_a_token_sees_its_own_jobs(self):
        tokens = self.folder / "tokens"
        tokens.write_text(f"alice {ALICE}\nbob {BOB}\n")
        tokens.chmod(0o600)
        self.restart("--token-file", str(tokens))
        alice, bob = ({"Authorization": f"Bearer {token}"} for token in (ALICE, BOB))
        info = self.submit(JOB, Prefer="wait=30", **alice)
        self.assertEqual(info["owner"], "alice")
        job = info["jobID"]
        for path in ("", "/document", "/events", "/results", "/results/table"):
            status, problem = self.call("GET", f"/jobs/{job}{path}", **bob)
            self.assertEqual((status, problem["type"].rsplit("/", 1)[1]), (404, "no-such-job"), path)
            self.assertEqual(self.call("GET", f"/jobs/{job}{path}", **alice)[0], 200, path)
        self.assertEqual(self.call("DELETE", f"/jobs/{job}", **bob)[0], 404)
        self.assertEqual(self.call("GET", "/jobs", **bob)[1]["jobs"], [])
        self.assertEqual(len(self.call("GET", "/jobs", **alice)[1]["jobs"]), 1)

    def test_filters_of_the_list(self):
        job = self.submit(JOB, Prefer="wait=30")
        def ids(query):
            status, page = self.call("GET", f"/jobs?{query}")
            self.assertEqual(status, 200, page)
            return [entry["jobID"] for entry in page["jobs"]]
        mine = [job["jobID"]]
        created = job["created"]
        self.assertEqual(ids(f"datetime={created}"), mine)
        self.assertEqual(ids(f"datetime=../{created}"), mine)
        self.assertEqual(ids(f"datetime={created}/.."), mine)
        self.assertEqual(ids("datetime=../2001-01-01T00:00:00Z"), [])
        self.assertEqual(ids("minDuration=3600"), [])
        self.assertEqual(ids("maxDuration=3600&type=process&processID=brdf&status=successful,failed"), mine)
        self.assertEqual(ids("processID=reference"), [])
        for query in ("datetime=yesterday", "minDuration=-1", "type=thing", "status=done"):
            self.assertEqual(self.call("GET", f"/jobs?{query}")[0], 400, query)

    def test_statistics(self):
        info = self.call("POST", "/processes/statistics/execution", {"inputs": {"surface": GROOVE}}, Prefer="wait=30")[1]
        self.assertEqual(info["status"], "successful", info)
        _, report = self.call("GET", f"/jobs/{info['jobID']}/results/report")
        self.assertAlmostEqual(report["max_slope"], 1, places=5)
        self.assertEqual(report["nx"], 16)
        _, picture = self.call("GET", f"/jobs/{info['jobID']}/results/hillshade")
        self.assertEqual(picture[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">II", picture[16:24])[0], 16)

    def test_text_and_maps_by_hash(self):
        rows = 8
        text = "\n".join(" ".join(str((i % 4) * 1e-4) for i in range(rows)) for _ in range(rows)).encode()
        image = b"Pf\n8 8\n-1.0\n" + struct.pack("<64f", *([0.25, 0.75] * 32))
        inputs = {**JOB, "surface": {"sha256": self.put(text), "pitch": "1 mm", "height_scale": "1 m"},
                  "material": {"model": "lambertian", "albedo": {"sha256": self.put(image)}}}
        info = self.submit(inputs, Prefer="wait=30")
        self.assertEqual(info["status"], "successful", info)
        (self.folder / "heights.txt").write_bytes(text)
        (self.folder / "map.pfm").write_bytes(image)
        local = {**inputs, "surface": {**inputs["surface"], "file": "heights.txt"},
                 "material": {"model": "lambertian", "albedo": {"file": "map.pfm"}}}
        del local["surface"]["sha256"]
        self.assertEqual(self.table(info["jobID"]), self.local(local))
        detail = self.refused({**inputs, "material": {"model": "lambertian", "albedo": {"sha256": "0" * 64}}}, 400,
                              "/inputs/material/albedo/sha256")
        self.assertIn("was not uploaded", detail)

    @not_sanitized
    def test_shards_decode_exr_of_a_stranger_elsewhere_too(self):
        window = [struct.pack("<4i", 0, 0, x, y) for x, y in ((7, 3), (16383, 8191))]
        (self.folder / "large.exr").write_bytes(exr(8, 4, [0] * 32).replace(*window))
        job = {**JOB, "surface": {"file": "large.exr", "pitch": "1 mm", "height_scale": "1 m"},
               "output": [{"format": "csv", "path": "a.csv"}]}
        (self.folder / "job.json").write_text(json.dumps(job))
        said = [subprocess.run([GONIO, "shard", "--job", "job.json", "--index", "0", "--checkpoints", "work", *flag],
                               cwd=self.folder, capture_output=True, text=True, check=False).stderr for flag in ([], ["--untrusted"])]
        self.assertIn("truncated or damaged", said[0])
        self.assertIn("more than the configured limit of 67108864 points", said[1])

    @not_sanitized
    def test_exr_of_a_stranger(self):
        data, surface = exr(8, 4, [1e-3 * (k % 8) for k in range(32)]), {"pitch": "1 mm", "height_scale": "1 m"}
        (self.folder / "a.exr").write_bytes(data)
        local = subprocess.run([GONIO, "info", "a.exr", "--pitch", "1mm", "--height-scale", "1m", "--json"], cwd=self.folder,
                               check=True, capture_output=True, text=True)
        status, answer = self.call("POST", "/processes/statistics/execution",
                                   {"inputs": {"surface": {"sha256": self.put(data), **surface}}}, Prefer="wait=30")
        self.assertEqual((status, answer.get("status")), (201, "successful"), answer)
        report = self.call("GET", f"/jobs/{answer['jobID']}/results/report")[1]
        self.assertEqual(report["surface_hash"], json.loads(local.stdout)["surface_hash"])
        # What it cannot be used for is said in the words of the command line.
        (self.folder / "b.exr").write_bytes(data[:-40])
        local = subprocess.run([GONIO, "info", "b.exr", "--pitch", "1mm", "--height-scale", "1m"], cwd=self.folder,
                               capture_output=True, text=True)
        detail = self.refused({"surface": {"sha256": self.put(data[:-40]), **surface}}, 400, "/inputs", "statistics")
        self.assertIn(local.stderr.strip().rsplit(": ", 1)[1], detail)
        # Whatever a damaged file does to the decoder, the service lives and says so.
        for k in range(0, min(len(data), 400), 7):
            damaged = bytearray(data)
            damaged[k] ^= 0x5A
            status, _ = self.call("POST", "/processes/statistics/execution",
                                  {"inputs": {"surface": {"sha256": self.put(bytes(damaged)), **surface}}})
            self.assertIn(status, (201, 400, 422))
        self.assertEqual(self.call("GET", "/healthz")[0], 200)

    def test_every_member_of_a_job_document_is_an_input(self):
        measure = {"kind": "brdf", "incident": {"list_deg": [[30, 0]]}, "outgoing": {"list_deg": [[20, 90]]}, "max_order": 2}
        curved = {**JOB, "measure": measure, "base": {"kappa_1": 5, "kappa_2": 2, "direction_deg": 30}}
        info = self.submit(curved, Prefer="wait=30")
        self.assertEqual(info["status"], "successful", info)
        self.assertEqual(self.table(info["jobID"]), self.local(curved))
        members = set(json.loads(subprocess.run([GONIO, "schema"], check=True, capture_output=True, text=True).stdout)["properties"])
        kinds = ("brdf", "btf", "light_field", "maps", "relight")
        inputs = set().union(*(self.call("GET", f"/processes/{kind}")[1]["inputs"] for kind in kinds))
        self.assertEqual(inputs, members - {"$schema", "output"})

    @not_sanitized
    def test_environment_of_a_stranger(self):
        sky = exr(16, 8, [0.25 * (k % 16) for k in range(128)])
        (self.folder / "sky.exr").write_bytes(sky)
        inputs = {**JOB, "environment": {"sha256": self.put(sky), "rotation_deg": 20},
                  "measure": {"kind": "relight", "outgoing": {"list_deg": [[30, 0]]}}}
        info = self.submit(inputs, "relight", Prefer="wait=30")
        self.assertEqual(info["status"], "successful", info)
        local = {**inputs, "environment": {"file": "sky.exr", "rotation_deg": 20}}
        self.assertEqual(self.call("GET", f"/jobs/{info['jobID']}/results/relight?f=csv")[1], self.local(local))
        detail = self.refused({**inputs, "environment": {"sha256": self.put(sky[:-40])}}, 400, "/inputs", "relight")
        self.assertIn("damaged", detail)

    def test_metrics(self):
        self.restart("--admin-listen", "127.0.0.1:0")
        service, admin = self.daemon.port, int(self.daemon.process.stdout.readline().rsplit(":", 1)[1])
        self.submit(JOB, Prefer="wait=30")
        self.assertEqual(self.call("GET", "/metrics")[0], 404)  # not for everybody
        self.daemon.port = admin
        end = time.monotonic() + 10
        while True:  # a computation is counted just after its job has ended
            status, text = self.call("GET", "/metrics")
            if b'gonio_jobs_total{' in text or time.monotonic() > end:
                break
        self.assertEqual(status, 200)
        lines = dict(line.rsplit(" ", 1) for line in text.decode().splitlines() if line and line[0] != "#")
        self.assertEqual(lines['gonio_jobs_total{process="brdf",status="successful"}'], "1")
        self.assertEqual(float(lines['gonio_http_requests_total{method="POST",route="/processes",status="201"}']), 1)
        self.assertGreater(float(lines["process_resident_memory_bytes"]), 1e6)
        self.assertEqual(self.call("GET", "/readyz")[0], 200)
        self.daemon.port = service

    def test_retention(self):
        job = self.submit(JOB, Prefer="wait=30")["jobID"]
        self.table(job)
        self.kill()
        report = json.loads(subprocess.run([GONIO, "store", "check", "--data", self.folder / "data"], check=True,
                                           capture_output=True).stdout)
        self.assertEqual(report["faults"], [])
        subprocess.run([GONIO, "store", "export", job, "--data", self.folder / "data", "-o", self.folder / "copy"], check=True)
        subprocess.run(["sha256sum", "--quiet", "-c", "SHA256SUMS"], cwd=self.folder / "copy", check=True)
        self.assertEqual((self.folder / "copy/table.csv").read_bytes(), self.local(JOB))
        damaged = next(path for path in (self.folder / "data/objects").rglob("*")
                       if path.is_file() and path.stat().st_size == len(self.local(JOB)))
        kept = damaged.read_bytes()
        damaged.write_bytes(kept[:-1] + b"?")
        self.assertEqual(subprocess.run([GONIO, "store", "check", "--data", self.folder / "data"],
                                        capture_output=True).returncode, 1)
        damaged.write_bytes(kept)
        report = json.loads(subprocess.run([GONIO, "store", "gc", "--data", self.folder / "data", "--quota-bytes", "0"],
                                           check=True, capture_output=True).stdout)
        self.assertEqual((report["bytes_after"], report["results_removed"]), (0, 1))
        self.start()
        status, problem = self.call("GET", f"/jobs/{job}/results")
        self.assertEqual(status, 410, problem)
        self.assertIn("expires", self.call("GET", f"/jobs/{job}")[1])
        again = self.submit(JOB, Prefer="wait=30")
        self.assertEqual(self.table(again["jobID"]), self.local(JOB))
        self.assertEqual(self.table(job), self.local(JOB))  # the old job has its results again


    def test_a_surface_that_is_read_stays_longer(self):
        older, newer = self.put(b"1 2\n3 4\n"), self.put(b"5 6\n7 8\n")
        time.sleep(0.01)  # times are kept to the millisecond
        self.assertEqual(self.call("GET", f"/surfaces/{older}")[0], 200)
        self.put(b"9")  # what is written next takes the time of the reading along
        self.kill()
        subprocess.run([GONIO, "store", "gc", "--data", self.folder / "data", "--quota-bytes", "9"], check=True, capture_output=True)
        self.start()
        self.assertEqual([self.call("HEAD", f"/surfaces/{name}")[0] for name in (older, newer)], [200, 404])


if __name__ == "__main__":
    unittest.main()
