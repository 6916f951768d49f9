#!/usr/bin/env python3
"""Four times the jobs that fit, for a minute: 429 with Retry-After, nothing lost, memory flat, back at once.

Clients that do not wait as long as they are told keep a queue of 20 jobs full, from which the daemon takes as many as it
can compute. What is acknowledged must end well; memory may not grow with what is refused; after the load has gone a job
is accepted at the first attempt.

Usage: overload_test.py GONIO SOURCE_FOLDER [--seconds N]
"""
import argparse
import http.client
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time

parser = argparse.ArgumentParser()
parser.add_argument("gonio")
parser.add_argument("source")
parser.add_argument("--seconds", type=float, default=60)
arguments = parser.parse_args()

QUEUE, CLIENTS = 20, 16
DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}


def job(seed):
    return {"surface": {"generate": "gaussian", "samples": 64, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 0.7},
            "material": {"model": "lambertian", "albedo": 0.5},
            "measure": {"kind": "brdf", "incident": DIRECTIONS, "outgoing": DIRECTIONS}, "accuracy": {"seed": seed}}


def ask(port, method, path, body=None):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request(method, path, None if body is None else json.dumps(body), {} if body is None else {"Content-Type": "application/json"})
        response = connection.getresponse()
        return response.status, response.headers, json.loads(response.read())
    finally:
        connection.close()


def memory_mib(process):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text()).group(1)) / 1024


def main():
    folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_overload_"))
    process = subprocess.Popen([os.path.abspath(arguments.gonio), "serve", "--data", str(folder / "data"), "--listen", "127.0.0.1:0",
                                "--threads", "1", "--max-queue", str(QUEUE), "--max-jobs-per-token", "100000"],
                               stdout=subprocess.PIPE, text=True)
    faults, accepted, refused, stop = [], [], [], threading.Event()
    try:
        port = int(process.stdout.readline().rsplit(":", 1)[1])

        def load(k):
            seed = k * 10**6
            while not stop.is_set():
                status, headers, body = ask(port, "POST", "/processes/brdf/execution", {"inputs": job(seed)})
                seed += 1
                if status == 201:
                    accepted.append(body["jobID"])
                elif status == 429 and int(headers.get("Retry-After", 0)) >= 1 and "queue is full" in body["detail"]:
                    refused.append(status)
                    stop.wait(0.05)
                else:
                    faults.append(f"{status} {body}")
                    return

        threads = [threading.Thread(target=load, args=(k,)) for k in range(CLIENTS)]
        for thread in threads:
            thread.start()
        memory = []
        for _ in range(10):
            time.sleep(arguments.seconds / 10)
            memory.append(memory_mib(process))
        stop.set()
        for thread in threads:
            thread.join()
        begin, status = time.monotonic(), 429
        while status == 429 and time.monotonic() < begin + 60:  # until one job of the full queue is done
            time.sleep(0.02)
            status, _, body = ask(port, "POST", "/processes/brdf/execution", {"inputs": job(1)})
        recovery = time.monotonic() - begin
        if status != 201:
            faults.append(f"not back after 60 s: {status} {body}")
        end = time.monotonic() + 120
        for identifier in accepted:
            while (info := ask(port, "GET", f"/jobs/{identifier}")[2]).get("status") in ("accepted", "running") and time.monotonic() < end:
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
        process.kill()
        process.wait()
        shutil.rmtree(folder)


sys.exit(main())
