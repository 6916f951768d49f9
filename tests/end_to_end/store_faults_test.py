#!/usr/bin/env python3
"""Every write, sync and rename of a small run fails once, with ENOSPC and with EIO; some fail from there on.

Usage: store_faults_test.py DRIVER FAULT_SHIM [--step N]
Required: nothing that was acknowledged is lost; one failure is survived with everything done, except a failed sync, which ends the
process at once; a healthy process then finishes everything.
"""
import pathlib
import shutil
import signal
import sys

from fault_campaign import campaign, parser
from store_judge import Driver, Promises, judge, rows

JOBS = 4


def run(arguments, root, fault, _):
    """One run with a fault: how it ended, and its faults."""
    folder = root / "data"
    shutil.rmtree(folder, ignore_errors=True)
    promises = Promises()
    status, errors = Driver(arguments.driver, folder, "sequence", 0, JOBS, promises=promises, env=fault.env).wait()
    call, path = (fault.failed() or [("", "")])[0]
    is_file = path and pathlib.Path(path).suffix != "" or "/tmp/" in path
    faults = list(promises.faults)

    if status == -signal.SIGABRT:
        if not fault.met_a_sync():
            faults.append("it aborted, but no sync had failed")
        if "cannot be synced" not in errors:
            faults.append(f"it aborted without saying why: {errors}")
    elif status in (3, 4):
        if str(folder) not in errors:
            faults.append(f"its message does not name the folder: {errors}")
        if status == 4 and not fault.stays:
            faults.append(f"one failure was not survived: {errors}")
    elif status == 0:
        if len(promises.acknowledged) != JOBS or len(promises.done) != JOBS // 2:
            faults.append(f"it ended well with {len(promises.acknowledged)} jobs and {len(promises.done)} results")
        if call in ("fsync", "fdatasync") and is_file:
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
    return f"exit {status}", faults


if __name__ == "__main__":
    sys.exit(campaign(parser("driver").parse_args(), run))
