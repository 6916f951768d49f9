"""What the tests of the store share: running the driver, remembering what it promised, judging what is left.

The judge reads the tables and the objects by itself; it does not ask the store.
"""
import hashlib
import os
import pathlib
import sqlite3
import subprocess
import threading


class Promises:
    """Lines of the driver: what had been acknowledged when."""

    def __init__(self):
        self.acknowledged = {}  # key -> id
        self.done = {}  # job_hash -> sha256
        self.faults = []

    def take(self, line):
        word, *rest = line.split()
        known = {"ACK": self.acknowledged, "DONE": self.done}.get(word)
        if known is None or len(rest) != 2:
            return
        if known.setdefault(rest[0], rest[1]) != rest[1]:
            self.faults.append(f"{word} {rest[0]}: was {known[rest[0]]}, now {rest[1]}")


class Driver:
    """A running driver; a thread takes its lines."""

    def __init__(self, program, folder, *arguments, promises=None, env=None):
        self.process = subprocess.Popen([program, str(folder), *map(str, arguments)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True, env={**os.environ, **(env or {})})
        self.lines = []
        self.promises = promises
        self.reader = threading.Thread(target=self.read)
        self.reader.start()

    def read(self):
        for line in self.process.stdout:
            if not line.endswith("\n"):  # cut off in the middle: not said
                break
            self.lines.append(line)
            if self.promises:
                self.promises.take(line)

    def wait(self):
        """Exit status and what it said on stderr."""
        errors = self.process.stderr.read()
        self.reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        return self.process.wait(), errors


def rows(folder, sql):
    connection = sqlite3.connect(f"{folder}/jobs.db", timeout=20)
    try:
        return connection.execute(sql).fetchall()
    finally:
        connection.close()


def judge(folder, acknowledged, done):
    """Everything that is not as promised; `folder` must have no running owner."""
    faults = []
    try:
        if (answer := rows(folder, "PRAGMA integrity_check")[0][0]) != "ok":
            faults.append(f"integrity: {answer}")
        jobs = rows(folder, "SELECT owner, idempotency_key, id FROM jobs")
        results = rows(folder, "SELECT job_hash, name, sha256, bytes FROM results")
        parts = rows(folder, "SELECT runs_hash, key, sha256, bytes FROM checkpoints")
        unfounded = rows(folder, "SELECT id FROM jobs WHERE status='successful' AND job_hash NOT IN (SELECT job_hash FROM results)")
    except sqlite3.Error as error:
        return [f"database: {error}"]
    ids = {key: identity for _, key, identity in jobs}
    if len(ids) != len(jobs):
        faults.append("duplicate: two jobs of one idempotency key")
    faults += [f"lost job: {key}" for key, identity in acknowledged.items() if ids.get(key) != identity]
    tables = {job_hash: sha256 for job_hash, name, sha256, _ in results if name == "table.bin"}
    faults += [f"lost result: {job_hash}" for job_hash, sha256 in done.items() if tables.get(job_hash) != sha256]
    faults += [f"no result: successful job {identity}" for (identity,) in unfounded]
    for job_hash, name, sha256, size in results + parts:
        path = pathlib.Path(folder, "objects", sha256[:2], sha256)
        try:
            content = path.read_bytes()
        except OSError:
            faults.append(f"missing object: {name} of {job_hash}")
            continue
        if len(content) != size or hashlib.sha256(content).hexdigest() != sha256:
            faults.append(f"bad object: {name} of {job_hash}")
    return faults


def tables_of(folder):
    return dict(rows(folder, "SELECT job_hash, sha256 FROM results WHERE name='table.bin'"))
