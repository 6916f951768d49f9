#!/usr/bin/env python3
"""Every write, sync and rename of a daemon fails once, with ENOSPC and with EIO; some fail from there on.

Usage: daemon_faults_test.py GONIO SOURCE_FOLDER FAULT_SHIM [--step N]
A client uploads a surface and submits two jobs meanwhile. Required: an answer to every request, and 503 or less alarming ones only;
the process ends at once after a failed sync, and for nothing else; one failure is survived with every job done; a healthy process
then has every job that was acknowledged, done, and each table has the bytes of `gonio run`.
"""
import hashlib
import http.client
import json
import pathlib
import shutil
import signal
import subprocess
import sys
import time

from daemon import Daemon
from fault_campaign import campaign, parser

DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}
REST = {"material": {"model": "lambertian", "albedo": 0.5}, "measure": {"kind": "brdf", "incident": DIRECTIONS, "outgoing": DIRECTIONS}}
GENERATED = {**REST, "surface": {"generate": "v_groove", "samples": 8, "period": "1mm", "slope_deg": 45}}
SCALE = {"width": "50mm", "height_range": "5mm", "resample": [16, 16]}


def is_done(state):
    return state is not None and state["status"] not in ("accepted", "running")


def told(state):
    return state and f"{state['status']} {state.get('message', '')}".strip()


class Client:
    """Tries again after a 503, as it is told to, while the daemon lives."""

    def __init__(self, daemon):
        self.daemon, self.acknowledged, self.faults = daemon, {}, []

    def ask(self, *request, **headers):
        """Status and answer; None once the daemon is gone."""
        for _ in range(3):
            try:
                status, _, answer = self.daemon.ask(*request, **headers)
            except (OSError, http.client.HTTPException):
                return None
            if status != 503:
                if status >= 400:
                    self.faults.append(f"{request[:2]}: {status} {answer}")
                    return None
                return answer
            time.sleep(0.02)
        return None

    def work(self, surface, seconds):
        digest = hashlib.sha256(surface).hexdigest()
        uploaded = {**REST, "surface": {"sha256": digest, **SCALE}}
        stored = self.ask("PUT", f"/surfaces/{digest}", surface) is not None
        for name, document in (("generated", GENERATED), *((("uploaded", uploaded),) if stored else ())):
            answer = self.ask("POST", "/processes/brdf/execution", {"inputs": document}, Idempotency_Key=name)
            if answer:
                self.acknowledged[name] = answer["jobID"]
        return self.wait(seconds)

    def wait(self, seconds):
        """The jobs by their names, once all have ended or the time is over."""
        end = time.monotonic() + seconds
        while True:
            states = {name: self.ask("GET", f"/jobs/{job}") for name, job in self.acknowledged.items()}
            if all(map(is_done, states.values())) or self.daemon.process.poll() is not None or time.monotonic() > end:
                return states
            time.sleep(0.01)


def run(arguments, root, fault, tables):
    """One life with a fault, and a healthy one: how the first ended, and what is wrong."""
    data, said = root / "data", root / "said"
    shutil.rmtree(data, ignore_errors=True)
    daemon = Daemon(arguments.gonio, data)
    client, states, started = Client(daemon), {}, True
    with open(said, "w", encoding="utf-8") as stderr:
        try:
            daemon.start(env=fault.env, stderr=stderr)
            states = client.work(image_of(arguments).read_bytes(), 1.5 if fault.stays else 20)
        except RuntimeError:
            started = False
        code = daemon.process.poll()
        daemon.kill()
    faults, errors = client.faults, said.read_text()
    if code == -signal.SIGABRT:
        if not fault.met_a_sync() or "cannot be synced" not in errors:
            faults.append(f"it aborted, but not for a failed sync: {errors}")
    elif code is not None and (started or code != 1 or str(data) not in errors):
        faults.append(f"it ended with {code}: {errors}")
    elif started and not fault.stays and fault.failed():
        faults += [f"job {name}: {told(state)}" for name, state in states.items() if told(state) != "successful"]
        if len(states) < 2:
            faults.append(f"after one failure only {list(states)} could be submitted")

    healthy = Daemon(arguments.gonio, data)
    healthy.start()
    try:
        after = Client(healthy)
        after.acknowledged = client.acknowledged
        for name, state in after.wait(20).items():
            if told(state) != "successful":
                faults.append(f"then job {name}: {told(state)}")
            elif after.ask("GET", f"/jobs/{client.acknowledged[name]}/results/table?f=csv") != tables[name]:
                faults.append(f"the table of {name} is not that of gonio run")
        faults += after.faults
    finally:
        healthy.kill()
    check = subprocess.run([arguments.gonio, "store", "check", "--data", str(data)], capture_output=True, text=True, check=False)
    if check.returncode != 0:
        faults.append(check.stdout)
    return "it aborted" if code == -signal.SIGABRT else "it did not start" if not started else "it went on", faults


def image_of(arguments):
    return pathlib.Path(arguments.source, "tests/samples/lava_rock_256_16bit.png")


def local_tables(arguments, root):
    tables = {}
    for name, surface in (("generated", GENERATED["surface"]), ("uploaded", {"file": str(image_of(arguments)), **SCALE})):
        job = {**REST, "surface": surface, "output": [{"format": "csv", "path": f"{name}.csv"}]}
        (root / "job.json").write_text(json.dumps(job))
        subprocess.run([arguments.gonio, "run", "job.json", "-q"], cwd=root, check=True)
        tables[name] = (root / f"{name}.csv").read_bytes()
    return tables


if __name__ == "__main__":
    options = parser("gonio", "source").parse_args()
    sys.exit(campaign(options, run, lambda root: local_tables(options, root)))
