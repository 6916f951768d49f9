#!/usr/bin/python3
"""Asks a running service for its health, runs small jobs on it and prints the id of one. Another has an
OpenEXR file: it is decoded by a child process, behind whatever walls the service has.

Usage: job_check.py http://HOST:PORT [--token TOKEN] [--again JOB_ID] [--wait SECONDS]
--again: no new job; the table of an older one must still be there.
"""
import argparse
import hashlib
import json
import pathlib
import time
import urllib.error
import urllib.request

JOB = {"inputs": {
    "surface": {"generate": "v_groove", "samples": 16, "period": "1mm", "slope_deg": 45},
    "material": {"model": "lambertian", "albedo": 0.5},
    "measure": {"kind": "brdf", "incident": {"theta_deg": [0, 45], "phi_deg": [0]},
                "outgoing": {"theta_deg": [0, 30], "phi_deg": [0, 180]}}}}

# Of the seeds of the fuzz target, whose first byte is not of the file.
EXR = (pathlib.Path(__file__).parent / "../fuzz/corpus/heights/exr_zip").read_bytes()[1:]

parser = argparse.ArgumentParser()
parser.add_argument("url")
parser.add_argument("--token")
parser.add_argument("--again")
parser.add_argument("--wait", type=float, default=60, help="seconds for the service to come up")
arguments = parser.parse_args()


def call(path: str, document: dict | bytes | None = None, accept: str = "application/json") -> bytes:
    is_upload = isinstance(document, bytes)
    headers = {"Accept": accept, "Content-Type": "application/octet-stream" if is_upload else "application/json"}
    if arguments.token:
        headers["Authorization"] = f"Bearer {arguments.token}"
    data = document if is_upload or document is None else json.dumps(document).encode()
    request = urllib.request.Request(arguments.url + path, data, headers, method="PUT" if is_upload else None)
    with urllib.request.urlopen(request, timeout=60) as response:
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


def new_job(process: str, document: dict) -> str:
    job = json.loads(call(f"/processes/{process}/execution", document))["jobID"]
    end = time.monotonic() + 120
    while (status := json.loads(call(f"/jobs/{job}"))["status"]) in ("accepted", "running"):
        assert time.monotonic() < end, f"job {job} is still {status}"
        time.sleep(0.1)
    assert status == "successful", status
    return job


wait_until_up()
call("/healthz")
job_id = arguments.again or new_job("brdf", JOB)
table = call(f"/jobs/{job_id}/results/table", accept="text/csv").decode()
rows = [line for line in table.splitlines() if line and not line.startswith("#")]
assert len(rows) == 1 + 2 * 4, table  # a head, then 2 incident and 4 outgoing directions
if not arguments.again:
    digest = hashlib.sha256(EXR).hexdigest()
    call(f"/surfaces/{digest}", EXR)
    surface = {"sha256": digest, "pitch": "1 um", "height_scale": "1 um"}
    report = json.loads(call(f"/jobs/{new_job('statistics', {'inputs': {'surface': surface}})}/results/report"))
    assert report["nx"] > 1, report
print(job_id)
