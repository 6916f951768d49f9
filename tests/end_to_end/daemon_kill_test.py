#!/usr/bin/env python3
"""The whole daemon under SIGKILL: what it acknowledged is there afterwards, and every table has the bytes of an undisturbed run.

Clients submit small jobs, each with an Idempotency-Key, while the daemon is killed at random instants and started again
on the same folder and port. Afterwards: every acknowledged job is there and successful, equal jobs have equal tables, a
sample of them (and the long ones, which were killed in the middle) has the bytes of `gonio run`, no key made two jobs.

Usage: daemon_kill_test.py GONIO SOURCE_FOLDER [--kills N] [--jobs N] [--patience SECONDS]
"""
import argparse
import hashlib
import http.client
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time

from daemon import Daemon

parser = argparse.ArgumentParser()
parser.add_argument("gonio")
parser.add_argument("source")
parser.add_argument("--kills", type=int, default=100)
parser.add_argument("--jobs", type=int, default=1000)
parser.add_argument("--patience", type=float, default=300, help="for the jobs to end after the last kill")
arguments = parser.parse_args()
GONIO = os.path.abspath(arguments.gonio)

DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}
MEASURE = {"kind": "brdf", "incident": DIRECTIONS, "outgoing": DIRECTIONS}


def small(k):
    """250 different jobs of some milliseconds."""
    return {"surface": {"generate": "v_groove", "samples": 8, "period": "1mm", "slope_deg": 20 + k % 50},
            "material": {"model": "lambertian", "albedo": round(0.1 + 0.1 * (k // 50 % 5), 1)}, "measure": MEASURE,
            "accuracy": {"target_relative_error": 0.05}}


def long(seed):
    """Some seconds, in several runs that are checkpoints."""
    hemisphere = {"hemisphere": 64}
    return {"surface": {"generate": "gaussian", "samples": 96, "pitch": "1 um", "correlation_length": "3 um", "rms_slope": 1},
            "material": {"model": "lambertian", "albedo": 0.5},
            "measure": {"kind": "brdf", "incident": hemisphere, "outgoing": hemisphere},
            "accuracy": {"target_relative_error": 0.003, "seed": seed}}


class Client(threading.Thread):
    """Submits its share; tries again with the same key until it is acknowledged."""

    def __init__(self, service, documents, stop):
        super().__init__()
        self.service, self.documents, self.stop = service, documents, stop
        self.acknowledged, self.repeated, self.faults = [], 0, []

    def run(self):
        for name, document in self.documents:
            while not self.stop.is_set():
                try:
                    status, _, answer = self.service.ask("POST", "/processes/brdf/execution", {"inputs": document},
                                                                   Idempotency_Key=name)
                except (OSError, http.client.HTTPException, ValueError):  # an answer that was cut off
                    self.repeated += 1
                    time.sleep(0.02)
                    continue
                if status == 201:
                    self.acknowledged.append((name, answer["jobID"], document))
                    break
                if status not in (429, 503):
                    self.faults.append(f"{status} {answer}")
                    break


def local_table(folder, document):
    (folder / "job.json").write_text(json.dumps({**document, "output": [{"format": "csv", "path": "local.csv"}]}))
    subprocess.run([GONIO, "run", "job.json", "-q", "--threads", "2"], cwd=folder, check=True)
    return (folder / "local.csv").read_bytes()


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_kill_"))
    daemon, stop = Daemon(GONIO, folder / "data"), threading.Event()
    quotas = ("--max-queue", "100000", "--max-jobs-per-token", "100000")
    choice = random.Random(1)
    try:
        documents = [(f"small-{k}", small(k)) for k in range(arguments.jobs)]
        documents[50:50] = [(f"long-{seed}", long(seed)) for seed in (1, 2, 3)]
        daemon.start(*quotas)
        clients = [Client(daemon, documents[k::4], stop) for k in range(4)]
        for client in clients:
            client.start()
        begin = time.monotonic()
        for _ in range(arguments.kills):
            time.sleep(choice.uniform(0.002, 0.25))
            daemon.kill()
            daemon.start(*quotas, port=daemon.port)
        under_kills = sum(len(client.acknowledged) for client in clients)
        for client in clients:
            client.join()
        acknowledged = [entry for client in clients for entry in client.acknowledged]
        faults = [fault for client in clients for fault in client.faults]
        took = time.monotonic() - begin

        # Every 201 is there and comes to its end.
        end = time.monotonic() + arguments.patience
        unfinished = {job for _, job, _ in acknowledged}
        while unfinished and time.monotonic() < end:
            for job in list(unfinished):
                status, _, state = daemon.ask("GET", f"/jobs/{job}")
                if status != 200:
                    faults.append(f"job {job}: {status}")
                    unfinished.discard(job)
                elif state["status"] not in ("accepted", "running"):
                    unfinished.discard(job)
                    if state["status"] != "successful":
                        faults.append(f"job {job}: {state}")
            time.sleep(0.1)
        faults += [f"job {job}: not finished" for job in unfinished]
        listed, following = [], "/jobs?limit=1000"
        while following:
            page = daemon.ask("GET", following)[2]
            listed += [job["jobID"] for job in page["jobs"]]
            following = next((link["href"] for link in page["links"] if link["rel"] == "next"), None)
        if sorted(listed) != sorted(job for _, job, _ in acknowledged):
            faults.append(f"{len(acknowledged)} jobs were acknowledged, {len(listed)} are there")

        # Every table: equal documents, equal bytes; of all different ones, those of an undisturbed run.
        tables = {}
        for name, job, document in acknowledged:
            status, _, body = daemon.ask("GET", f"/jobs/{job}/results/table?f=csv")
            digest = hashlib.sha256(body).hexdigest() if status == 200 else ""
            if status != 200 or tables.setdefault(json.dumps(document), digest) != digest:
                faults.append(f"job {job} ({name}): table is {status}, or not that of its equals")
        sample = choice.sample(sorted(tables), min(40, len(tables))) + [json.dumps(long(seed)) for seed in (1, 2, 3)]
        for text in sample:
            if tables.get(text) != hashlib.sha256(local_table(folder, json.loads(text))).hexdigest():
                faults.append(f"the table of {text} is not that of gonio run")
        daemon.kill()
        check = subprocess.run([GONIO, "store", "check", "--data", str(folder / "data")], capture_output=True, text=True)
        if check.returncode != 0:
            faults.append(check.stdout)
        print(f"{arguments.kills} kills in {took:.0f} s, {len(acknowledged)} jobs acknowledged ({under_kills} between kills), "
              f"{sum(client.repeated for client in clients)} attempts repeated, {len(tables)} different tables, "
              f"{len(sample)} held against gonio run: {len(faults)} faults")
        for fault in faults[:20]:
            print(fault)
        return 1 if faults else 0
    finally:
        stop.set()
        if daemon.process and daemon.process.poll() is None:
            daemon.kill()
        shutil.rmtree(folder)


sys.exit(main())
