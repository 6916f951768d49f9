#!/usr/bin/python3
"""Asks a running service for its health, runs a small job on it and prints the job's id.

Usage: job_check.py http://HOST:PORT [--token TOKEN] [--again JOB_ID] [--wait SECONDS]
--again: no new job; the table of an older one must still be there.
"""
import argparse
import json
import time
import urllib.error
import urllib.request

JOB = {"inputs": {
    "surface": {"generate": "v_groove", "samples": 16, "period": "1mm", "slope_deg": 45},
    "material": {"model": "lambertian", "albedo": 0.5},
    "measure": {"kind": "brdf", "incident": {"theta_deg": [0, 45], "phi_deg": [0]},
                "outgoing": {"theta_deg": [0, 30], "phi_deg": [0, 180]}}}}

parser = argparse.ArgumentParser()
parser.add_argument("url")
parser.add_argument("--token")
parser.add_argument("--again")
parser.add_argument("--wait", type=float, default=60, help="seconds for the service to come up")
arguments = parser.parse_args()


def call(path: str, document: dict | None = None, accept: str = "application/json") -> bytes:
    headers = {"Accept": accept, "Content-Type": "application/json"}
    if arguments.token:
        headers["Authorization"] = f"Bearer {arguments.token}"
    data = json.dumps(document).encode() if document else None
    with urllib.request.urlopen(urllib.request.Request(arguments.url + path, data, headers), timeout=60) as response:
        return response.read()


def wait_until_up() -> None:
    end = time.monotonic() + arguments.wait
    while True:
        try:
            call("/readyz")
            return
        except (urllib.error.URLError, ConnectionError):
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def new_job() -> str:
    job = json.loads(call("/processes/brdf/execution", JOB))["jobID"]
    end = time.monotonic() + 120
    while (status := json.loads(call(f"/jobs/{job}"))["status"]) in ("accepted", "running"):
        assert time.monotonic() < end, f"job {job} is still {status}"
        time.sleep(0.1)
    assert status == "successful", status
    return job


wait_until_up()
call("/healthz")
job_id = arguments.again or new_job()
table = call(f"/jobs/{job_id}/results/table", accept="text/csv").decode()
rows = [line for line in table.splitlines() if line and not line.startswith("#")]
assert len(rows) == 1 + 2 * 4, table  # a head, then 2 incident and 4 outgoing directions
print(job_id)
