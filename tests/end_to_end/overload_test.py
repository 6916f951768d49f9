#!/usr/bin/env python3
"""Four times the jobs that fit, for a while: 429 with Retry-After, nothing lost, memory flat, back at once.

Clients that do not wait as long as they are told keep a queue of 20 jobs full, from which the daemon takes as many as it
can compute. What is acknowledged must end well; memory may not grow with what is refused; after the load has gone a job
is accepted at the first attempt.

Usage: overload_test.py GONIO SOURCE_FOLDER [--seconds N]
"""
import argparse
import os
import pathlib
import shutil
import sys
import tempfile
import threading
import time

from daemon import Daemon

parser = argparse.ArgumentParser()
parser.add_argument("gonio")
parser.add_argument("source")
parser.add_argument("--seconds", type=float, default=20)
arguments = parser.parse_args()

QUEUE, CLIENTS = 20, 16
DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}


def job(seed):
    return {"surface": {"generate": "gaussian", "samples": 64, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 0.7},
            "material": {"model": "lambertian", "albedo": 0.5},
            "measure": {"kind": "brdf", "incident": DIRECTIONS, "outgoing": DIRECTIONS}, "accuracy": {"seed": seed}}


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_overload_"))
    daemon = Daemon(os.path.abspath(arguments.gonio), folder / "data")
    daemon.start("--max-queue", str(QUEUE), "--max-jobs-per-token", "100000")
    faults, accepted, refused, stop = [], [], [], threading.Event()
    try:
        def load(k):
            seed = k * 10**6
            while not stop.is_set():
                status, headers, body = daemon.ask("POST", "/processes/brdf/execution", {"inputs": job(seed)})
                seed += 1
                if status == 201:
                    accepted.append(body["jobID"])
                elif status == 429 and int(headers.get("Retry-After", 0)) >= 1 and "queue is full" in body["detail"]:
                    refused.append(status)
                    stop.wait(0.016)  # as many refusals in 20 s as pauses of 0.05 s give in a minute
                else:
                    faults.append(f"{status} {body}")
                    return

        threads = [threading.Thread(target=load, args=(k,)) for k in range(CLIENTS)]
        for thread in threads:
            thread.start()
        memory = []
        for _ in range(10):
            time.sleep(arguments.seconds / 10)
            memory.append(daemon.memory_mib())
        stop.set()
        for thread in threads:
            thread.join()
        begin, status = time.monotonic(), 429
        while status == 429 and time.monotonic() < begin + 60:  # until one job of the full queue is done
            time.sleep(0.02)
            status, _, body = daemon.ask("POST", "/processes/brdf/execution", {"inputs": job(1)})
        recovery = time.monotonic() - begin
        if status != 201:
            faults.append(f"not back after 60 s: {status} {body}")
        end = time.monotonic() + 120
        for identifier in accepted:
            while (info := daemon.ask("GET", f"/jobs/{identifier}")[2]).get("status") in ("accepted", "running") and time.monotonic() < end:
                time.sleep(0.01)
            if info.get("status") != "successful":
                faults.append(str(info))
        if len(refused) < 3 * len(accepted):
            faults.append("that was no overload")
        if memory[-1] > memory[2] + 32:
            faults.append(f"memory grew from {memory[2]:.0f} to {memory[-1]:.0f} MiB")
        print(f"{arguments.seconds:.0f} s: {len(accepted)} accepted, {len(refused)} refused, memory {memory[0]:.0f}, {memory[4]:.0f}, "
              f"{memory[-1]:.0f} MiB, next job accepted after {recovery:.2f} s, {len(faults)} faults")
        for fault in faults[:10]:
            print(fault)
        return 1 if faults else 0
    finally:
        stop.set()
        daemon.kill()
        shutil.rmtree(folder)


sys.exit(main())
