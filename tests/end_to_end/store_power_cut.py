#!/usr/bin/env python3
"""Power cuts: what the store acknowledged before the power went is there when it comes back.

Usage: store_power_cut.py DRIVER MUTANT_DRIVER [--cuts 200] [--mutant-cuts 20] [--folder /var/tmp]
Needs root, loop devices, mkfs.xfs and mkfs.ext4, and 2 GB below --folder; without them it says so and ends with 77 (skipped).

The store runs on ext4 in an image file that lies on XFS. A reflink copy of the image is, at one instant, exactly what has reached
"the disk": what the page cache still held is gone. The copy is mounted (ext4 replays its journal) and judged. A disk that loses or
reorders what it has confirmed is not modelled. The mutants (no fsync, synchronous=NORMAL) must lose something.
"""
import argparse
import collections
import contextlib
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

from store_judge import Driver, Promises, judge

SKIPPED = 77


def command(*words):
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def unmount(folder):
    for _ in range(100):
        if subprocess.run(["umount", str(folder)], stderr=subprocess.DEVNULL).returncode == 0:
            return
        time.sleep(0.1)
    raise RuntimeError(f"{folder} cannot be unmounted")


@contextlib.contextmanager
def mounted(image, folder):
    folder.mkdir(exist_ok=True)
    command("mount", "-o", "loop", image, folder)
    try:
        yield
    finally:
        unmount(folder)


@contextlib.contextmanager
def image(path, size, *make):
    with open(path, "wb") as file:
        file.truncate(size)
    command(*make, path)
    try:
        yield
    finally:
        path.unlink()


def cut_once(program, root, chance, promises, first, env):
    """Runs the driver, cuts the power at some instant; what is wrong on the disk that remains."""
    disk, copy, seen = root / "xfs/disk.img", root / "xfs/copy.img", root / "seen"
    driver = Driver(program, root / "live/data", "both", first, 400, promises=promises, env=env)
    try:
        time.sleep(chance.uniform(0.05, 0.5))
        # Said strictly before the cut: dictionaries are copied first.
        acknowledged, done = dict(promises.acknowledged), dict(promises.done)
        command("cp", "--reflink=always", disk, copy)
    finally:
        driver.process.kill()
        driver.wait()
    with mounted(copy, seen):
        # Before the first promise there may not even be tables.
        faults = judge(seen / "data", acknowledged, done) if acknowledged else []
        # And a store that starts on what is left says the same of all its objects.
        if not faults and Driver(program, seen / "data", "verify").wait()[0]:
            faults.append("verify: refused")
        return faults


def campaign(program, root, cuts, chance, mutant=None):
    env = {"GONIO_STORE_MUTANT": mutant} if mutant else {}
    shutil.rmtree(root / "live/data", ignore_errors=True)
    promises, kinds, bad_cuts, jobs, results, first = Promises(), collections.Counter(), 0, 0, 0, 0
    start = time.monotonic()
    for _ in range(cuts):
        faults = cut_once(program, root, chance, promises, first, env) + promises.faults
        bad_cuts += bool(faults)
        if faults and not mutant:
            print("FAULT", *faults[:3], sep="\n  ", flush=True)
        kinds.update(fault.split(":")[0] for fault in faults)
        first = 2 * max(len(promises.acknowledged), first // 2)
        state = os.statvfs(root / "live")
        if state.f_bavail * state.f_frsize < 150e6:
            jobs, results, first = jobs + len(promises.acknowledged), results + len(promises.done), 0
            shutil.rmtree(root / "live/data")
            promises = Promises()
    jobs, results = jobs + len(promises.acknowledged), results + len(promises.done)
    print(f"{mutant or 'as it is':20} {cuts} cuts, {jobs} jobs, {results} results: {bad_cuts} cuts with damage {dict(kinds)} "
          f"in {time.monotonic() - start:.0f} s", flush=True)
    return bad_cuts


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("driver")
    parser.add_argument("mutant_driver")
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--mutant-cuts", type=int, default=20)
    parser.add_argument("--folder", default="/var/tmp")
    arguments = parser.parse_args()
    missing = [tool for tool in ("mkfs.xfs", "mkfs.ext4", "mount") if not shutil.which(tool)]
    if os.geteuid() != 0 or missing or not os.path.exists("/dev/loop-control"):
        print(f"skipped: needs root, loop devices, xfsprogs and e2fsprogs (missing: {', '.join(missing) or 'root or loop devices'})")
        return SKIPPED
    seed = random.randrange(1 << 30)
    chance = random.Random(seed)
    root = pathlib.Path(tempfile.mkdtemp(prefix="gonio_power_cut_", dir=arguments.folder))
    wrong = []
    try:
        with contextlib.ExitStack() as stack:
            stack.enter_context(image(root / "xfs.img", 2 << 30, "mkfs.xfs", "-q", "-m", "reflink=1"))
            try:
                stack.enter_context(mounted(root / "xfs.img", root / "xfs"))
            except subprocess.CalledProcessError as error:
                print(f"skipped: loop devices cannot be mounted here ({error.stderr.strip()})")
                return SKIPPED
            stack.enter_context(image(root / "xfs/disk.img", 512 << 20, "mkfs.ext4", "-q", "-F"))
            stack.enter_context(mounted(root / "xfs/disk.img", root / "live"))
            if campaign(arguments.driver, root, arguments.cuts, chance):
                wrong.append("the store lost what it had acknowledged")
            for mutant in ("no_fsync", "synchronous_normal"):
                if not campaign(arguments.mutant_driver, root, arguments.mutant_cuts, chance, mutant):
                    wrong.append(f"the mutant {mutant} was not caught: this test has no teeth")
    finally:
        shutil.rmtree(root)
    for line in wrong:
        print("FAULT", line)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
