#!/usr/bin/env python3
"""kill -9 at random instants: what the store acknowledged is there afterwards, and results are those of an undisturbed run.

Usage: store_kill_test.py DRIVER MUTANT_DRIVER [--kills 200] [--jobs 2000] [--seed N]
The mutant that writes objects in place must be caught by the same test: a test that it passes has no teeth.
"""
import argparse
import os
import random
import shutil
import sys
import tempfile
import time

from store_judge import Driver, Promises, judge, rows, tables_of


def kill_loop(program, folder, kills, jobs, chance, env=None, pace=1):
    """Kills the driver so many times while it accepts `jobs` jobs; the faults found."""
    promises = Promises()
    faults = []
    for kill in range(kills):
        first = (kill * jobs) // kills
        count = ((kill + 1) * jobs) // kills - first
        # Some of the round before once more: their keys must lead to the same jobs.
        again = min(first, chance.randrange(count + 1))
        driver = Driver(program, folder, "both", first - again, count + again, promises=promises, env=env)
        time.sleep(pace * chance.choice([chance.uniform(0.002, 0.03), chance.uniform(0.03, 0.15)]))
        driver.process.kill()
        status, errors = driver.wait()
        if status not in (0, -9) or errors:
            faults.append(f"kill {kill}: exit {status}: {errors.strip()}")
        if kill % 40 == 39:
            faults += judge(folder, promises.acknowledged, promises.done)
        if faults:
            break
    return promises, faults + promises.faults


def finish(program, folder, jobs, promises):
    """Submits everything once more, undisturbed, and lets the workers end."""
    driver = Driver(program, folder, "both", 0, jobs, promises=promises)
    status, errors = driver.wait()
    faults = [f"the last run: exit {status}: {errors}"] if status else []
    states = dict(rows(folder, "SELECT status, count(*) FROM jobs GROUP BY status"))
    if states != {"successful": jobs}:
        faults.append(f"after the last run the jobs are {states}, not {jobs} successful")
    driver = Driver(program, folder, "verify")
    status, errors = driver.wait()
    if status:
        faults.append(f"verify: exit {status}: {''.join(driver.lines)}{errors}")
    if left := os.listdir(f"{folder}/tmp"):
        faults.append(f"left in tmp: {left}")
    return faults + promises.faults + judge(folder, promises.acknowledged, promises.done)


def test_store(arguments, root, chance):
    start = time.monotonic()
    calm, faults = f"{root}/calm", []
    # A loop that kills before anything happens would find nothing: a slow machine is given longer.
    for pace in (1, 3, 9):
        killed = f"{root}/killed{pace}"
        promises, found = kill_loop(arguments.driver, killed, arguments.kills, arguments.jobs, chance, pace=pace)
        faults += found
        before = (len(promises.acknowledged), len(promises.done))
        enough = before[0] > arguments.jobs / 2 and before[1] > arguments.jobs / 20
        if enough or faults:
            break
    if os.path.isdir(killed):
        faults += judge(killed, promises.acknowledged, promises.done)
    faults += finish(arguments.driver, killed, arguments.jobs, promises)
    faults += finish(arguments.driver, calm, arguments.jobs, Promises())
    if tables_of(killed) != tables_of(calm):
        faults.append("the results differ from those of the undisturbed run")
    print(f"{arguments.kills} kills: {before[0]} of {arguments.jobs} jobs acknowledged and {before[1]} results done under them; "
          f"{len(faults)} faults in {time.monotonic() - start:.1f} s")
    if not enough:
        faults.append("too little was acknowledged under the kills to judge by")
    return faults


def test_mutant(arguments, root, chance):
    for attempt in range(5):
        folder = f"{root}/mutant{attempt}"
        promises, faults = kill_loop(arguments.mutant_driver, folder, arguments.kills, arguments.jobs, chance,
                                     {"GONIO_STORE_MUTANT": "no_rename"})
        driver = Driver(arguments.mutant_driver, folder, "both", 0, arguments.jobs, promises=promises,
                        env={"GONIO_STORE_MUTANT": "no_rename"})
        driver.wait()
        faults += judge(folder, promises.acknowledged, promises.done)
        bad = [fault for fault in faults if fault.startswith("bad object")]
        print(f"mutant without rename: {len(bad)} bad objects")
        if bad:
            return []
    return ["the mutant that writes objects in place was not caught"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("driver")
    parser.add_argument("mutant_driver")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=None)
    arguments = parser.parse_args()
    seed = random.randrange(1 << 30) if arguments.seed is None else arguments.seed
    print(f"--seed {seed}")
    root = tempfile.mkdtemp(prefix="gonio_store_")
    try:
        chance = random.Random(seed)
        faults = test_store(arguments, root, chance) + test_mutant(arguments, root, chance)
    finally:
        shutil.rmtree(root)
    for fault in faults[:20]:
        print("FAULT", fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
