#!/usr/bin/env python3
"""The service as clients meet it: jobs, results, surfaces, cancellation, death and drain.

Usage: serve_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import contextlib
import hashlib
import http.client
import json
import re
import signal
import sqlite3
import subprocess
import time
import unittest

from service_fixture import GONIO, GROOVE, JOB, LAVA, LONG, MANY_RUNS, MEDIUM, Service


class Api(Service):
    def test_documents(self):
        status, landing = self.call("GET", "/")
        self.assertEqual(status, 200)
        for link in landing["links"]:
            self.assertEqual(self.call("GET", link["href"])[0], 200, link)
        _, conformance = self.call("GET", "/conformance")
        self.assertIn("http://www.opengis.net/spec/ogcapi-processes-1/1.0/conf/core", conformance["conformsTo"])
        _, processes = self.call("GET", "/processes")
        self.assertIn("brdf", [process["id"] for process in processes["processes"]])
        for process in processes["processes"]:
            status, description = self.call("GET", f"/processes/{process['id']}")
            self.assertEqual(status, 200)
            self.assertIn("surface", description["inputs"])
            self.assertIn("report", description["outputs"])
        status, problem = self.call("GET", "/processes/nothing")
        self.assertEqual((status, problem["type"]),
                         (404, "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/no-such-process"))
        self.assertEqual(self.call("GET", "/healthz")[0], 200)
        self.assertEqual(self.call("GET", "/readyz")[0], 200)

    def test_job_gives_the_bytes_of_the_command_line(self):
        info = self.submit(JOB)
        self.assertEqual(self.headers["Location"], "/jobs/" + info["jobID"])
        self.assertEqual(self.wait(info["jobID"])["status"], "successful")
        self.assertEqual(self.table(info["jobID"]), self.local(JOB))
        digest = hashlib.sha256(self.table(info["jobID"])).hexdigest()
        self.assertEqual(self.headers["ETag"], f'"{digest}"')
        status, results = self.call("GET", f"/jobs/{info['jobID']}/results")
        self.assertEqual((status, set(results)), (200, {"table", "report"}))
        for name, media_type in (("table", "text/csv"), ("table", "application/json"), ("table", "image/x-exr"),
                                 ("report", "application/json")):
            status, _ = self.call("GET", f"/jobs/{info['jobID']}/results/{name}", Accept=media_type)
            self.assertEqual((status, self.headers["Content-Type"]), (200, media_type))
        self.assertEqual(self.call("GET", f"/jobs/{info['jobID']}/results/table", Accept="image/gif")[0], 406)
        status, part = self.call("GET", f"/jobs/{info['jobID']}/results/table?f=csv", Range="bytes=0-9")
        self.assertEqual((status, part), (206, self.table(info["jobID"])[:10]))

    def test_equal_jobs_are_computed_once(self):
        first = self.submit(JOB, Prefer="wait=30")
        self.assertEqual(first["status"], "successful")
        again = self.submit({**JOB, "surface": {**GROOVE, "period": "1000 um"}})
        self.assertEqual((again["status"], again["job_hash"]), ("successful", first["job_hash"]))
        self.assertNotEqual(again["jobID"], first["jobID"])

    def test_finer_target_takes_the_runs_that_are_there(self):
        surface = {"generate": "gaussian", "samples": 512, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 0.7}
        coarse, fine = ({**JOB, "surface": surface, "accuracy": {"target_relative_error": target}} for target in (0.005, 0.003))
        self.assertEqual(self.submit(coarse, Prefer="wait=30")["status"], "successful")
        self.restart()
        job = self.submit(fine, Prefer="wait=30")
        self.assertEqual(job["status"], "successful")
        report = self.call("GET", f"/jobs/{job['jobID']}/results/report")[1]
        self.assertIn("6 runs", str(report), "those of the first job")
        self.assertEqual(self.table(job["jobID"]), self.local(fine))

    def test_idempotency_key(self):
        first = self.submit(JOB, Idempotency_Key="a")
        self.assertEqual(self.submit(JOB, Idempotency_Key="a")["jobID"], first["jobID"])
        status, problem = self.call("POST", "/processes/brdf/execution",
                                    {"inputs": {**JOB, "material": {"model": "lambertian", "albedo": 0.6}}},
                                    Idempotency_Key="a")
        self.assertEqual(status, 422, problem)

    def test_bad_fields_are_named(self):
        for inputs, pointer in (({**JOB, "material": {"model": "lambertian", "albedo": 2}}, "/inputs/material/albedo"),
                                ({**JOB, "surface": {"file": "/etc/passwd"}}, "/inputs/surface/file"),
                                ({**JOB, "surface": {"sha256": "0" * 64}}, "/inputs/surface/sha256"),
                                ({**JOB, "material": {"model": "lambertian", "albedo": {"file": "x"}}},
                                 "/inputs/material/albedo/file"),
                                ({"surface": GROOVE}, "/inputs/material"),
                                ({**JOB, "nonsense": 1}, "/inputs/nonsense")):
            status, problem = self.call("POST", "/processes/brdf/execution", {"inputs": inputs})
            self.assertEqual(status, 400, problem)
            self.assertEqual(problem["errors"][0]["pointer"], pointer)
        self.assertEqual(self.call("GET", "/jobs")[1]["jobs"], [])
        self.assertEqual(self.call("GET", "/jobs/none")[0], 404)

    def test_uploaded_surface(self):
        data = LAVA.read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        self.assertEqual(self.call("PUT", f"/surfaces/{digest}", data)[0], 201)
        self.assertEqual(self.call("PUT", f"/surfaces/{digest}", data)[0], 200)
        self.assertEqual(self.call("GET", f"/surfaces/{digest}")[1], data)
        self.assertEqual(self.call("HEAD", f"/surfaces/{digest}")[0], 200)
        self.assertEqual(self.call("PUT", f"/surfaces/{'0' * 64}", data)[0], 400)
        self.assertEqual(self.call("HEAD", f"/surfaces/{'0' * 64}")[0], 404)
        units = {"width": "50mm", "height_range": "5mm", "resample": [64, 64]}
        accuracy = {"accuracy": {"target_relative_error": 0.02}}
        info = self.submit({**JOB, **accuracy, "surface": {"sha256": digest, **units}}, Prefer="wait=30")
        self.assertEqual(info["status"], "successful", info)
        self.assertEqual(self.table(info["jobID"]),
                         self.local({**JOB, **accuracy, "surface": {"file": str(LAVA), **units}}))

    def test_dismiss_stops_within_a_second(self):
        job = self.submit(LONG)["jobID"]
        while self.call("GET", f"/jobs/{job}")[1]["status"] != "running":
            time.sleep(0.02)
        status, problem = self.call("GET", f"/jobs/{job}/results")
        self.assertEqual((status, problem["type"].rsplit("/", 1)[1]), (404, "result-not-ready"))
        time.sleep(0.5)
        begin = time.monotonic()
        status, info = self.call("DELETE", f"/jobs/{job}")
        self.assertEqual((status, info["status"]), (200, "dismissed"))
        self.assertLess(time.monotonic() - begin, 2)
        self.assertEqual(self.submit(JOB, Prefer="wait=30")["status"], "successful")

    def test_events(self):
        # A stream may leave out what lasted less than half a second, so: a job that only ends when it is told to.
        job = self.submit(MANY_RUNS)["jobID"]
        connection = http.client.HTTPConnection("127.0.0.1", self.daemon.port, timeout=120)
        self.addCleanup(connection.close)
        connection.request("GET", f"/jobs/{job}/events")
        response = connection.getresponse()
        text = ""
        while text.count("event: running") < 2:
            text += response.readline().decode()
        self.assertEqual(self.call("DELETE", f"/jobs/{job}")[0], 200)
        text += response.read().decode()  # to its end
        names = re.findall(r"^event: (\w+)$", text, re.M)
        self.assertEqual(names[-1], "dismissed")
        ids = [int(number) for number in re.findall(r"^id: (\d+)$", text, re.M)]
        self.assertEqual(ids, sorted(set(ids)))
        for data in re.findall(r"^data: (.*)$", text, re.M):
            self.assertEqual(json.loads(data)["jobID"], job)
        # Who comes back with the last id that it saw gets what came after it.
        _, text = self.call("GET", f"/jobs/{job}/events", Last_Event_ID=str(ids[-2]))
        self.assertEqual(re.findall(r"^event: (\w+)$", text.decode(), re.M), ["dismissed"])

    def test_list(self):
        jobs = [self.submit({**JOB, "material": {"model": "lambertian", "albedo": a}}, Prefer="wait=30")["jobID"]
                for a in (0.1, 0.2, 0.3)]
        _, page = self.call("GET", "/jobs?limit=2")
        self.assertEqual([job["jobID"] for job in page["jobs"]], jobs[:0:-1])
        following = next(link["href"] for link in page["links"] if link["rel"] == "next")
        self.assertEqual([job["jobID"] for job in self.call("GET", following)[1]["jobs"]], jobs[:1])
        self.assertEqual(len(self.call("GET", "/jobs?status=successful")[1]["jobs"]), 3)
        self.assertEqual(self.call("GET", "/jobs?status=failed")[1]["jobs"], [])
        self.assertEqual(self.call("GET", "/jobs?limit=0")[0], 400)


class Ends(Service):
    def test_kill_9_loses_nothing(self):
        jobs = [self.submit(inputs)["jobID"] for inputs in (MEDIUM, JOB)]
        for _ in range(4):
            time.sleep(0.7)
            self.kill()
            self.start()
        self.assertEqual([self.wait(job)["status"] for job in jobs], ["successful"] * 2)
        self.assertEqual(self.table(jobs[0]), self.local(MEDIUM))

    def test_shards_of_an_executor_have_the_same_bytes(self):
        self.restart("--executor", "local", "--shared-folder", str(self.folder / "shared"))
        digest = hashlib.sha256(LAVA.read_bytes()).hexdigest()
        self.call("PUT", f"/surfaces/{digest}", LAVA.read_bytes())
        units = {"width": "50mm", "height_range": "5mm", "resample": [64, 64]}
        accuracy = {"accuracy": {"target_relative_error": 0.02}}
        job = self.submit({**JOB, **accuracy, "surface": {"sha256": digest, **units}})["jobID"]
        self.assertEqual(self.wait(job)["status"], "successful")
        self.assertEqual(self.table(job), self.local({**JOB, **accuracy, "surface": {"file": str(LAVA), **units}}))
        self.assertEqual(list((self.folder / "shared").iterdir()), [])

    def test_sigterm_drains(self):
        longer = {**MEDIUM, "accuracy": {"target_relative_error": 0.001}}
        job = self.submit(longer)["jobID"]
        while self.call("GET", f"/jobs/{job}")[1]["status"] != "running":
            time.sleep(0.01)
        begin = time.monotonic()
        self.daemon.process.send_signal(signal.SIGTERM)
        self.assertEqual(self.daemon.process.wait(20), 0)
        self.assertLess(time.monotonic() - begin, 10)
        self.daemon.process.stdout.close()
        with contextlib.closing(sqlite3.connect(self.folder / "data/jobs.db")) as database:
            self.assertEqual(database.execute("SELECT status, attempts FROM jobs").fetchall(), [("accepted", 0)], "back in the queue")
        self.start()
        self.assertEqual(self.wait(job)["status"], "successful")
        self.assertEqual(self.table(job), self.local(longer))

    def test_tokens(self):
        tokens = self.folder / "tokens"
        tokens.write_text("alice 0123456789abcdef0123456789abcdef\n")
        tokens.chmod(0o600)
        self.kill()
        self.start("--token-file", str(tokens))
        self.assertEqual(self.call("GET", "/jobs")[0], 401)
        self.assertEqual(self.call("GET", "/jobs", Authorization="Bearer 0123456789abcdef0123456789abcdee")[0], 401)
        self.assertEqual(self.call("GET", "/jobs", Authorization="Bearer 0123456789abcdef0123456789abcdef")[0], 200)
        self.assertEqual(self.call("GET", "/healthz")[0], 200)
        refused = subprocess.run([GONIO, "serve", "--data", str(self.folder / "other"), "--listen", "0.0.0.0:0"],
                                 capture_output=True, text=True)
        self.assertEqual(refused.returncode, 2)
        self.assertIn("--token-file", refused.stderr)


if __name__ == "__main__":
    unittest.main()
