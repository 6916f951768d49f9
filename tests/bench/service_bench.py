#!/usr/bin/env python3
"""The service's figures, measured on one running daemon each: rates, overhead, memory, overload, hostile clients.

Usage: service_bench.py GONIO [--seconds N] [NAME ...]      names: status, loaded, overhead, large, hostile
Needs wrk (Debian package of that name) for status and loaded.
"""
import argparse
import datetime
import hashlib
import http.client
import json
import os
import pathlib
import re
import shutil
import socket
import statistics
import subprocess
import tempfile
import threading
import time

DIRECTIONS = {"theta_deg": [0, 45], "phi_deg": [0]}
SMALL = {"surface": {"generate": "v_groove", "samples": 8, "period": "1mm", "slope_deg": 45},
         "material": {"model": "lambertian", "albedo": 0.5}, "measure": {"kind": "brdf", "incident": DIRECTIONS, "outgoing": DIRECTIONS}}
TENTH = {"surface": {"generate": "gaussian", "samples": 64, "pitch": "1 um", "correlation_length": "8 um", "rms_slope": 0.5},
         "material": {"model": "lambertian", "albedo": 0.5},
         "measure": {"kind": "brdf", "incident": {"hemisphere": 32}, "outgoing": {"hemisphere": 32}}}
LONG = {"surface": {"generate": "gaussian", "samples": 512, "pitch": "1 um", "correlation_length": "4 um", "rms_slope": 1},
        "material": {"model": "lambertian", "albedo": 0.5},
        "measure": {"kind": "brdf", "incident": {"klems": "full"}, "outgoing": {"klems": "full"}},
        "accuracy": {"target_relative_error": 1e-5}}


class Daemon:
    def __init__(self, gonio, *options):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="gonio_bench_"))
        self.process = subprocess.Popen([gonio, "serve", "--data", str(self.folder / "data"), "--listen", "127.0.0.1:0", *options],
                                        stdout=subprocess.PIPE, text=True)
        self.port = int(re.search(r":(\d+)$", self.process.stdout.readline()).group(1))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()
        shutil.rmtree(self.folder)

    def connect(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=300)
        connection.connect()
        connection.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return connection

    def ask(self, connection, method, path, body=None, **headers):
        if isinstance(body, dict):
            body = json.dumps(body)
            headers["Content-Type"] = "application/json"
        connection.request(method, path, body, headers)
        response = connection.getresponse()
        data = response.read()
        return response.status, json.loads(data) if "json" in response.headers.get("Content-Type", "") else data

    def submit(self, inputs, **headers):
        status, info = self.ask(self.connect(), "POST", "/processes/brdf/execution", {"inputs": inputs}, **headers)
        assert status == 201, info
        return info

    def memory_mib(self, field="VmRSS"):
        text = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(field + r":\s+(\d+) kB", text).group(1)) / 1024


def wrk(daemon, job, seconds):
    done = subprocess.run(["wrk", "-t1", "-c32", f"-d{seconds}s", "--latency", f"http://127.0.0.1:{daemon.port}/jobs/{job}"],
                          capture_output=True, text=True, check=True).stdout
    rate = float(re.search(r"Requests/sec:\s+(\S+)", done).group(1))
    amount, unit = re.search(r"99%\s+([\d.]+)(us|ms|s)", done).groups()
    errors = re.search(r"Non-2xx.*|Socket errors.*", done)
    return rate, float(amount) * {"us": 1e-3, "ms": 1, "s": 1000}[unit], errors.group(0) if errors else "no errors"


def status(gonio, seconds):
    with Daemon(gonio, "--threads", "2") as daemon:
        job = daemon.submit(SMALL, Prefer="wait=30")["jobID"]
        rate, p99, errors = wrk(daemon, job, seconds)
        print(f"status, idle: {rate:.0f} calls/s, p99 {p99:.2f} ms, 32 keep-alive clients, {errors} (bar 10,000/s; wrk shares the cores)")


def loaded(gonio, seconds):
    with Daemon(gonio, "--threads", str(os.cpu_count())) as daemon:
        job = daemon.submit(SMALL, Prefer="wait=30")["jobID"]
        daemon.submit(LONG)
        time.sleep(3)
        rate, p99, errors = wrk(daemon, job, seconds)
        print(f"status, all cores computing: {rate:.0f} calls/s, p99 {p99:.1f} ms, {errors} (bar: p99 50 ms)")


def moment(text):
    return datetime.datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def overhead(gonio, _):
    """The job itself is what the daemon says it computed: from started to finished, to the millisecond."""
    with Daemon(gonio, "--threads", "1") as daemon:
        connection = daemon.connect()
        beyond, jobs = [], []
        for seed in range(41):
            begin = time.perf_counter()
            _, info = daemon.ask(connection, "POST", "/processes/brdf/execution",
                                 {"inputs": {**TENTH, "accuracy": {"target_relative_error": 0.003, "seed": seed}}}, Prefer="wait=30")
            daemon.ask(connection, "GET", f"/jobs/{info['jobID']}/results/table?f=csv")
            took = time.perf_counter() - begin
            jobs.append(moment(info["finished"]) - moment(info["started"]))
            beyond.append(took - jobs[-1])
        print(f"overhead: job {1000 * statistics.median(jobs):.0f} ms, submit to result beyond it: median "
              f"{1000 * statistics.median(beyond):.1f} ms, worst {1000 * max(beyond):.1f} ms of {len(jobs)} (bar 10 ms)")


def large(gonio, _):
    size = 1 << 30
    with Daemon(gonio, "--threads", "1") as daemon:
        path = daemon.folder / "large"
        block, digest = os.urandom(1 << 20), hashlib.sha256()
        with open(path, "wb") as file:
            for _ in range(size >> 20):
                file.write(block)
                digest.update(block)
            os.fsync(file.fileno())
        name, before = digest.hexdigest(), daemon.memory_mib()
        begin = time.perf_counter()
        with open(path, "rb") as file:
            answer = daemon.ask(daemon.connect(), "PUT", f"/surfaces/{name}", file, **{"Content-Length": str(size)})
        up = time.perf_counter() - begin
        assert answer[0] == 201, answer
        begin = time.perf_counter()
        connection = daemon.connect()
        connection.request("GET", f"/surfaces/{name}")
        response, received, check = connection.getresponse(), 0, hashlib.sha256()
        while piece := response.read(1 << 20):
            received += len(piece)
            check.update(piece)
        down = time.perf_counter() - begin
        assert check.hexdigest() == name
        begin = time.perf_counter()
        subprocess.run(["dd", f"if={path}", f"of={path}.copy", "bs=1M", "conv=fsync", "status=none"], check=True)
        copy = time.perf_counter() - begin
        print(f"1 GiB: up {up:.1f} s, down {down:.1f} s (a copy with dd and fsync {copy:.1f} s), memory {before:.0f} -> peak "
              f"{daemon.memory_mib('VmHWM'):.0f} MiB (bar: 64 MiB more)")


def hostile(gonio, seconds):
    with Daemon(gonio, "--threads", "1") as daemon:
        job = daemon.submit(SMALL, Prefer="wait=30")["jobID"]
        stop, slow = threading.Event(), []

        def drip(k):
            while not stop.is_set():
                try:
                    with socket.create_connection(("127.0.0.1", daemon.port), timeout=5) as client:
                        slow.append(1)
                        text = (b"GET /jobs HTTP/1.1\r\nHost: x\r\nX-Slow: " if k % 2 else
                                b"PUT /surfaces/" + b"0" * 64 + b" HTTP/1.1\r\nHost: x\r\nContent-Length: 100000\r\n\r\n")
                        client.sendall(text)
                        while not stop.is_set():
                            client.sendall(b"a")
                            stop.wait(0.5)
                except OSError:
                    stop.wait(0.05)

        threads = [threading.Thread(target=drip, args=(k,)) for k in range(200)]
        for thread in threads:
            thread.start()
        time.sleep(1)
        times, failures, end = [], 0, time.monotonic() + seconds
        while time.monotonic() < end:
            begin = time.perf_counter()
            try:
                connection = daemon.connect()  # each its own connection: the hard case
                if daemon.ask(connection, "GET", f"/jobs/{job}")[0] != 200:
                    failures += 1
                connection.close()
            except OSError:
                failures += 1
            times.append(1000 * (time.perf_counter() - begin))
            time.sleep(0.01)
        stop.set()
        for thread in threads:
            thread.join()
        times.sort()
        print(f"200 slow clients ({len(slow)} connections): honest p50 {times[len(times) // 2]:.1f} ms, "
              f"p99 {times[len(times) * 99 // 100]:.1f} ms, worst {times[-1]:.0f} ms of {len(times)}, {failures} failures (bar: p99 100 ms)")


def main():
    measures = {"status": status, "loaded": loaded, "overhead": overhead, "large": large, "hostile": hostile}
    parser = argparse.ArgumentParser()
    parser.add_argument("gonio")
    parser.add_argument("--seconds", type=int, default=10)
    parser.add_argument("names", nargs="*", help=", ".join(measures))
    arguments = parser.parse_intermixed_args()
    for name in arguments.names or measures:
        measures[name](os.path.abspath(arguments.gonio), arguments.seconds)


main()
