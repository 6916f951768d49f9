#!/usr/bin/env python3
"""Every write, sync and rename of a small run fails once, with ENOSPC and with EIO; some fail from there on.

Usage: store_faults_test.py DRIVER FAULT_SHIM [--step N]
Required: nothing that was acknowledged is lost; one failure is survived with everything done, except a failed sync, which ends the
process at once; a healthy process then finishes everything.
"""
import argparse
import collections
import os
import pathlib
import shutil
import signal
import sys
import tempfile
import time

from store_judge import Driver, Promises, judge, rows

JOBS = 4


def run(arguments, root, at, error, stays):
    """One run with a fault: how it ended, and its faults."""
    folder, log = pathlib.Path(root, "data"), pathlib.Path(root, "log")
    shutil.rmtree(folder, ignore_errors=True)
    log.unlink(missing_ok=True)
    env = {"LD_PRELOAD": arguments.fault_shim, "FAULT_AT": str(at), "FAULT_ERRNO": error, "FAULT_LOG": str(log)}
    if stays:
        env["FAULT_ALL"] = "1"
    promises = Promises()
    status, errors = Driver(arguments.driver, folder, "sequence", 0, JOBS, promises=promises, env=env).wait()
    said = log.read_text().splitlines() if log.exists() else []
    failed = [line for line in said if not line.startswith("calls ")]
    call, _, path = (failed or [" "])[0].partition(" ")
    is_file = path and pathlib.Path(path).suffix != "" or "/tmp/" in path
    faults = list(promises.faults)

    if status == -signal.SIGABRT:
        if not any(line.startswith(("fsync", "fdatasync")) for line in failed):
            faults.append("it aborted, but no sync had failed")
        if "cannot be synced" not in errors:
            faults.append(f"it aborted without saying why: {errors}")
    elif status in (3, 4):
        if str(folder) not in errors:
            faults.append(f"its message does not name the folder: {errors}")
        if status == 4 and not stays:
            faults.append(f"one failure was not survived: {errors}")
    elif status == 0:
        if len(promises.acknowledged) != JOBS or len(promises.done) != JOBS // 2:
            faults.append(f"it ended well with {len(promises.acknowledged)} jobs and {len(promises.done)} results")
        if failed and call in ("fsync", "fdatasync") and is_file:
            faults.append(f"{call} failed on {path} and the process went on")
    else:
        faults.append(f"exit {status}: {errors}")

    if (folder / "jobs.db").exists() and (folder / "jobs.db").stat().st_size:
        if status == 0 or promises.acknowledged:
            faults += judge(folder, promises.acknowledged, promises.done)
    elif promises.acknowledged:
        faults.append("the database is gone")
    healthy = Promises()
    healthy.acknowledged = dict(promises.acknowledged)
    healthy.done = dict(promises.done)
    second, errors = Driver(arguments.driver, folder, "sequence", 0, JOBS, promises=healthy).wait()
    if second or rows(folder, "SELECT DISTINCT status FROM jobs") != [("successful",)] or len(healthy.acknowledged) != JOBS:
        faults.append(f"a healthy process did not finish: exit {second}: {errors}")
    faults += healthy.faults + judge(folder, healthy.acknowledged, healthy.done)
    return call if failed else None, status, [f"call {at} ({call} {path}), {error}, {'stays' if stays else 'once'}: {f}" for f in faults]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("driver")
    parser.add_argument("fault_shim")
    parser.add_argument("--step", type=int, default=1)
    arguments = parser.parse_args()
    arguments.fault_shim = os.path.abspath(arguments.fault_shim)
    # In memory where that is possible: the faults come from the shim, and the syncs between them take no time.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    root = tempfile.mkdtemp(prefix="gonio_store_faults_", dir=memory)
    start, faults, endings = time.monotonic(), [], collections.Counter()
    runs = 0
    try:
        for error in ("ENOSPC", "EIO"):
            at = 1
            while True:
                call, status, found = run(arguments, root, at, error, stays=at % 5 == 0)
                runs += 1
                faults += found
                if call is None:  # the whole run needs fewer calls
                    break
                endings[call, status] += 1
                at += arguments.step
    finally:
        shutil.rmtree(root)
    for (call, status), count in sorted(endings.items()):
        print(f"{call} failed, exit {status}: {count}")
    print(f"{runs} runs, {len(faults)} faults in {time.monotonic() - start:.1f} s")
    if {call for call, _ in endings} < {"write", "pwrite", "fsync", "rename"}:
        faults.append("not every kind of call was met: does the shim work?")
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
