#!/usr/bin/env python3
"""Every write, sync and rename of a daemon fails once, with ENOSPC and with EIO; some fail from there on.

Usage: daemon_faults_test.py GONIO SOURCE_FOLDER FAULT_SHIM [--step N]
A client uploads a surface and submits two jobs meanwhile. Required: an answer to every request, and 503 or less alarming ones only;
the process ends at once after a failed sync, and for nothing else; one failure is survived with every job done; a healthy process
then has every job that was acknowledged, done, and each table has the bytes of `gonio run`.
"""
import argparse
import collections
import hashlib
import http.client
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from daemon import Daemon

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


def run(arguments, root, surface, tables, at, error, stays):
    """One life with a fault, and a healthy one: the call that failed, how the first ended, and what is wrong."""
    data, log, said = root / "data", root / "log", root / "said"
    shutil.rmtree(data, ignore_errors=True)
    log.unlink(missing_ok=True)
    env = {"LD_PRELOAD": arguments.fault_shim, "FAULT_AT": str(at), "FAULT_ERRNO": error, "FAULT_LOG": str(log)}
    if stays:
        env["FAULT_ALL"] = "1"
    daemon = Daemon(arguments.gonio, data)
    client, states, started = Client(daemon), {}, True
    with open(said, "w", encoding="utf-8") as stderr:
        try:
            daemon.start(env=env, stderr=stderr)
            states = client.work(surface, 1.5 if stays else 20)
        except RuntimeError:
            started = False
        code = daemon.process.poll()
        daemon.kill()
    failed = log.read_text().splitlines() if log.exists() else []
    call, _, path = (failed or [" "])[0].partition(" ")
    faults, errors = client.faults, said.read_text()
    if code == -signal.SIGABRT:
        if not any(line.startswith(("fsync", "fdatasync")) for line in failed) or "cannot be synced" not in errors:
            faults.append(f"it aborted, but not for a failed sync: {errors}")
    elif code is not None and (started or code != 1 or str(data) not in errors):
        faults.append(f"it ended with {code}: {errors}")
    elif started and not stays and failed:
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
    how = "aborted" if code == -signal.SIGABRT else "did not start" if not started else "went on"
    return call if failed else None, how, [f"call {at} ({call} {path}), {error}, {'stays' if stays else 'once'}: {f}" for f in faults]


def local_tables(arguments, root, image):
    tables = {}
    for name, surface in (("generated", GENERATED["surface"]), ("uploaded", {"file": str(image), **SCALE})):
        job = {**REST, "surface": surface, "output": [{"format": "csv", "path": f"{name}.csv"}]}
        (root / "job.json").write_text(json.dumps(job))
        subprocess.run([arguments.gonio, "run", "job.json", "-q"], cwd=root, check=True)
        tables[name] = (root / f"{name}.csv").read_bytes()
    return tables


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("gonio")
    parser.add_argument("source")
    parser.add_argument("fault_shim")
    parser.add_argument("--step", type=int, default=1)
    arguments = parser.parse_args()
    arguments.gonio, arguments.fault_shim = os.path.abspath(arguments.gonio), os.path.abspath(arguments.fault_shim)
    # In memory where that is possible: the faults come from the shim, and the syncs between them take no time.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    root = pathlib.Path(tempfile.mkdtemp(prefix="gonio_daemon_faults_", dir=memory))
    start, faults, endings, runs = time.monotonic(), [], collections.Counter(), 0
    try:
        image = pathlib.Path(arguments.source).resolve() / "tests/samples/lava_rock_256_16bit.png"
        tables = local_tables(arguments, root, image)
        for error in ("ENOSPC", "EIO"):
            at = 1
            while True:
                call, how, found = run(arguments, root, image.read_bytes(), tables, at, error, stays=runs % 4 == 3)
                runs += 1
                faults += found
                if call is None:  # the whole life needs fewer calls
                    break
                endings[call, how] += 1
                at += arguments.step
    finally:
        shutil.rmtree(root)
    for (call, how), count in sorted(endings.items()):
        print(f"{call} failed, it {how}: {count}")
    print(f"{runs} lives, {len(faults)} faults in {time.monotonic() - start:.1f} s")
    if not {"write", "pwrite", "fsync", "rename"} <= {call for call, _ in endings}:
        faults.append("not every kind of call was met: does the shim work?")
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
