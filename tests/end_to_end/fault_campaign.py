"""Runs under fault_shim.c, one for each call that it can fail."""
import argparse
import collections
import itertools
import os
import pathlib
import shutil
import tempfile
import time

KINDS = "write", "pwrite", "fsync", "rename"


class Fault:
    """The at-th call of a process, or of its calls of one kind, fails; all later ones, too, if it stays."""

    def __init__(self, shim, root, at, error, stays=False, kind=None):
        self.at, self.error, self.stays, self.log = at, error, stays, pathlib.Path(root, "log")
        self.log.unlink(missing_ok=True)
        self.env = {"LD_PRELOAD": shim, "FAULT_AT": str(at), "FAULT_ERRNO": error, "FAULT_LOG": str(self.log)}
        if stays:
            self.env["FAULT_ALL"] = "1"
        if kind:
            self.env["FAULT_CALL"] = kind

    def failed(self):
        """The calls that failed: (call, path)."""
        lines = self.log.read_text().splitlines() if self.log.exists() else []
        return [tuple(line.split(" ", 1)) for line in lines if not line.startswith("calls ")]

    def met_a_sync(self):
        return any(call in ("fsync", "fdatasync") for call, _ in self.failed())

    def __str__(self):
        call, path = (self.failed() or [("none", "")])[0]
        return f"call {self.at} ({call} {path}), {self.error}, {'stays' if self.stays else 'once'}"


def parser(*programs):
    arguments = argparse.ArgumentParser()
    for name in programs:
        arguments.add_argument(name, type=os.path.abspath)
    arguments.add_argument("fault_shim", type=os.path.abspath)
    arguments.add_argument("--step", type=int, default=1)
    return arguments


def campaign(arguments, run, prepare=lambda root: None):
    """Calls run(arguments, root, fault, what prepare gave), which returns how it ended and its faults, until no call is left to fail.

    Returns the exit code of the test.
    """
    # In memory where that is possible: the faults come from the shim, and the syncs between them take no time.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    root = pathlib.Path(tempfile.mkdtemp(prefix="gonio_faults_", dir=memory))
    start, faults, endings, runs = time.monotonic(), [], collections.Counter(), 0
    try:
        prepared = prepare(root)

        def fails(fault):
            nonlocal runs
            ending, found = run(arguments, root, fault, prepared)
            runs += 1
            faults.extend(f"{fault}: {one}" for one in found)
            if fault.failed():
                endings[fault.failed()[0][0], ending] += 1
            return fault.failed()

        for error in ("ENOSPC", "EIO"):
            for k in itertools.count():
                if not fails(Fault(arguments.fault_shim, root, 1 + k * arguments.step, error, stays=k % 5 == 4)):
                    break  # the whole run needs fewer calls
            # Few calls are renames: with a step, whether one of them is met is up to timing.
            for kind in KINDS if arguments.step > 1 else ():
                fails(Fault(arguments.fault_shim, root, 1, error, kind=kind))
    finally:
        shutil.rmtree(root)
    for (call, ending), count in sorted(endings.items()):
        print(f"{call} failed, {ending}: {count}")
    print(f"{runs} runs, {len(faults)} faults in {time.monotonic() - start:.1f} s")
    if not set(KINDS) <= {call for call, _ in endings}:
        faults.append("not every kind of call was met: does the shim work?")
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0
