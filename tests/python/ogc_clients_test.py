"""Clients that know nothing of gonio drive a job: OWSLib's OGC API - Processes, and curl."""
import json
import subprocess

from owslib.ogcapi.processes import Processes
from owslib.util import http_post
from support import JOB, ServiceTest, until

RESULTS = "http://www.opengis.net/def/rel/ogc/1.0/results"


class OgcClients(ServiceTest):
    def drive(self, get, execute):
        """A job by nothing but what the standard says; get(path or link) and execute(path, request) give JSON."""
        self.assertTrue(any(uri.endswith("/conf/core") for uri in get("conformance")["conformsTo"]))
        self.assertIn("brdf", [process["id"] for process in get("processes")["processes"]])
        inputs = {name: JOB[name] for name, about in get("processes/brdf")["inputs"].items() if about["minOccurs"]}
        job = execute("processes/brdf/execution", {"inputs": inputs})
        until(lambda: get(f"jobs/{job['jobID']}")["status"] not in ("accepted", "running"))
        done = get(f"jobs/{job['jobID']}")
        self.assertEqual(done["status"], "successful")
        [results] = [link["href"] for link in done["links"] if link["rel"] == RESULTS]
        [table] = [entry["href"] for entry in get(results.lstrip("/"))["table"] if entry["type"] == "application/json"]
        self.assertEqual(get(table.lstrip("/"))["format"], "gonio-table")

    def test_owslib(self):
        client = Processes(self.service.url)
        self.assertIn("surface", client.process("brdf")["inputs"])
        self.assertEqual(client.processes(), client._request("processes"))
        # Debian's version has no call for an execution yet: its own POST is what that call is made of.
        self.drive(client._request, lambda path, request: http_post(client._build_url(path), request).json())

    def test_curl(self):
        def curl(path, *options):
            return json.loads(subprocess.check_output(["curl", "-sSf", *options, f"{self.service.url}/{path}"]))

        json_type = ("-H", "Content-Type: application/json")
        self.drive(curl, lambda path, request: curl(path, *json_type, "-d", json.dumps(request)))
