#!/usr/bin/env python3
"""OGC API - Processes 1.0 (OGC 18-062r2), requirement by requirement: one test each, named after it.

Not here, because gonio does not claim or offer them: html, callback, synchronous execution and the outputs that come
with it (all processes say async-execute only), inputs by reference, bounding boxes, binary inputs (surfaces are uploaded).

Usage: ogc_conformance_test.py GONIO SOURCE_FOLDER [unittest options]
"""
import json
import unittest

from service_fixture import JOB, LONG, SOURCE, Service

EXCEPTIONS = "http://www.opengis.net/def/exceptions/ogcapi-processes-1/1.0/"
CONFORMANCE = "http://www.opengis.net/spec/ogcapi-processes-1/1.0/conf/"
RELATIONS = "http://www.opengis.net/def/rel/ogc/1.0/"


class Conformance(Service):
    @classmethod
    def setUpClass(cls):
        """One service for all: nothing here changes what another test sees."""
        cls.shared = Service()
        cls.shared.setUp()

    @classmethod
    def tearDownClass(cls):
        cls.shared.doCleanups()

    def setUp(self):
        self.daemon = self.shared.daemon

    def get(self, path, status=200, **headers):
        code, body = self.call("GET", path, **headers)
        self.assertEqual(code, status, body)
        return body

    def exception(self, path, kind, method="GET"):
        code, body = self.call(method, path)
        self.assertEqual(code, 404)
        self.assertEqual(body["type"], EXCEPTIONS + kind)
        self.assertTrue({"type", "title", "status", "detail"} <= set(body))

    def links(self, document):
        return {link["rel"]: link["href"] for link in document["links"]}

    # ---- core: landing page, API definition, conformance

    def test_core_landingpage(self):
        links = self.links(self.get("/"))
        for relation in ("service-desc", RELATIONS + "conformance", RELATIONS + "processes", RELATIONS + "job-list"):
            self.get(links[relation])

    def test_core_api_definition(self):
        definition = self.get(self.links(self.get("/"))["service-desc"])
        self.assertTrue(definition["openapi"].startswith("3.0."))
        self.assertTrue(self.headers["Content-Type"].startswith("application/vnd.oai.openapi+json"))

    def test_oas30_definition_names_every_route(self):
        paths = self.get("/api")["paths"]
        for path in ("/", "/api", "/conformance", "/processes", "/processes/{processID}", "/processes/{processID}/execution",
                     "/jobs", "/jobs/{jobID}", "/jobs/{jobID}/results", "/jobs/{jobID}/results/{outputID}",
                     "/jobs/{jobID}/events", "/jobs/{jobID}/document", "/surfaces/{sha256}", "/healthz", "/readyz"):
            self.assertIn(path, paths)
            for method, operation in paths[path].items():
                if method != "parameters":
                    self.assertTrue(operation["operationId"] and operation["responses"], path)
        with open(SOURCE / "server/service/openapi.json", encoding="utf-8") as file:
            self.assertEqual(json.load(file), self.get("/api"))

    def test_core_conformance(self):
        self.assertEqual(set(self.get("/conformance")["conformsTo"]),
                         {CONFORMANCE + name for name in
                          ("core", "ogc-process-description", "json", "oas30", "job-list", "dismiss")})

    def test_core_http_and_json(self):
        for path in ("/", "/conformance", "/processes", "/processes/brdf", "/jobs"):
            self.get(path)
            self.assertEqual(self.headers["Content-Type"], "application/json")

    # ---- core: processes

    def test_core_process_list(self):
        body = self.get("/processes")
        self.assertTrue(body["links"])
        for process in body["processes"]:
            self.assertTrue({"id", "version", "jobControlOptions", "outputTransmission"} <= set(process))

    def test_core_pl_limit(self):
        everything = [process["id"] for process in self.get("/processes?limit=10000")["processes"]]
        page, seen = self.get("/processes?limit=1"), []
        while True:
            self.assertEqual(len(page["processes"]), 1)
            seen.append(page["processes"][0]["id"])
            following = self.links(page).get("next")
            if not following:
                break
            page = self.get(following)
        self.assertEqual(seen, everything)
        for bad in ("0", "10001", "x"):
            self.get(f"/processes?limit={bad}", 400)

    def test_core_process_description(self):
        for summary in self.get("/processes")["processes"]:
            process = self.get(self.links(summary)["self"])
            self.assertEqual(process["id"], summary["id"])
            for part in ("inputs", "outputs"):
                self.assertTrue(process[part])
                for entry in process[part].values():
                    self.assertIn("schema", entry)

    def test_ogc_process_description_input_occurrence(self):
        inputs = self.get("/processes/brdf")["inputs"]
        self.assertEqual({name for name, entry in inputs.items() if entry["minOccurs"] == 1}, {"surface", "material", "measure"})

    def test_core_process_exception(self):
        self.exception("/processes/nothing", "no-such-process")

    # ---- core: execution

    def test_core_process_execute_unknown_process(self):
        code, body = self.call("POST", "/processes/nothing/execution", {"inputs": JOB})
        self.assertEqual((code, body["type"]), (404, EXCEPTIONS + "no-such-process"))

    def test_core_process_execute_async(self):
        for headers in ({}, {"Prefer": "respond-async"}):
            info = self.submit(JOB, **headers)
            self.assertEqual(self.headers["Location"], f"/jobs/{info['jobID']}")
            self.assertEqual(self.headers["Content-Type"], "application/json")

    def test_core_process_execute_validates_inputs(self):
        for inputs in ({}, {"surface": 1}, {**JOB, "unknown": 1}):
            code, body = self.call("POST", "/processes/brdf/execution", {"inputs": inputs})
            self.assertEqual(code, 400, body)
            self.assertTrue(body["errors"][0]["pointer"].startswith("/inputs"))
        self.assertEqual(self.call("POST", "/processes/brdf/execution", {})[0], 400)
        self.assertEqual(self.call("POST", "/processes/brdf/execution", "{", Content_Type="application/json")[0], 400)
        self.assertEqual(self.call("POST", "/processes/brdf/execution", "x", Content_Type="text/plain")[0], 415)

    # ---- core: jobs and results

    def test_core_job_status(self):
        info = self.submit(JOB, Prefer="wait=30")
        status = self.get(f"/jobs/{info['jobID']}")
        self.assertTrue({"jobID", "status", "type", "processID", "created", "updated", "links"} <= set(status))
        self.assertEqual((status["type"], status["status"]), ("process", "successful"))
        self.assertIn(RELATIONS + "results", self.links(status))

    def test_core_job_exception(self):
        self.exception("/jobs/none", "no-such-job")

    def test_core_job_results(self):
        info = self.submit(JOB, Prefer="wait=30")
        results = self.get(self.links(info)[RELATIONS + "results"])
        for name, formats in results.items():
            for entry in formats:
                self.get(entry["href"])
                self.assertEqual(self.headers["Content-Type"], entry["type"], name)

    def test_core_results_exceptions(self):
        self.exception("/jobs/none/results", "no-such-job")
        job = self.submit(LONG)["jobID"]
        self.exception(f"/jobs/{job}/results", "result-not-ready")
        self.call("DELETE", f"/jobs/{job}")

    # ---- job-list

    def test_job_list_limit_and_pages(self):
        for albedo in (0.11, 0.12, 0.13):
            self.submit({**JOB, "material": {"model": "lambertian", "albedo": albedo}}, Prefer="wait=30")
        everything = [job["jobID"] for job in self.get("/jobs?limit=10000")["jobs"]]
        page, seen = self.get("/jobs?limit=2&type=process"), []
        while page["jobs"]:
            self.assertLessEqual(len(page["jobs"]), 2)
            seen += [job["jobID"] for job in page["jobs"]]
            following = self.links(page).get("next")
            if not following:
                break
            self.assertIn("type=process", following)
            page = self.get(following)
        self.assertEqual(seen, everything)
        self.get("/jobs?limit=0", 400)

    def test_job_list_parameters(self):
        self.submit(JOB, Prefer="wait=30")
        for query, count in (("processID=brdf", True), ("processID=none", False), ("status=failed", False),
                             ("status=successful,failed", True), ("datetime=2000-01-01T00:00:00Z/..", True),
                             ("datetime=../2000-01-01T00:00:00Z", False), ("minDuration=86400", False), ("maxDuration=86400", True)):
            self.assertEqual(bool(self.get(f"/jobs?{query}")["jobs"]), count, query)

    def test_job_list_has_process_ids(self):
        self.submit(JOB, Prefer="wait=30")
        for job in self.get("/jobs")["jobs"]:
            self.assertTrue({"jobID", "processID", "status", "type"} <= set(job))

    # ---- dismiss

    def test_dismiss(self):
        job = self.submit(LONG)["jobID"]
        code, info = self.call("DELETE", f"/jobs/{job}")
        self.assertEqual((code, info["status"]), (200, "dismissed"))
        self.assertEqual(self.get(f"/jobs/{job}")["status"], "dismissed")

    def test_dismiss_exception(self):
        self.exception("/jobs/none", "no-such-job", "DELETE")


if __name__ == "__main__":
    unittest.main()
