"""The same job on this machine, by the program `gonio`, without a server."""
from __future__ import annotations

import json
import os
import re
import subprocess
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np

from .document import JobDocument, document_text, read_document, write_array
from .errors import GonioError, JobDismissed, JobFailed, Refused, TimedOut, Unreachable
from .projection import Projection, read_projection
from .status import Progress, Status, progress_callback
from .table import Table
from .table_files import read_table

Result = TypeVar("Result")
REFUSALS = ("invalid_input", "missing_unit", "not_found", "limit", "usage")


def run(job: JobDocument | None = None, /, *, program: str = "gonio", threads: int | None = None,
        progress: Progress = False, timeout: float | None = None, **members: Any) -> Table:
    """Runs a job by `gonio run` and returns its table: the same values as from a server.

    job, members: as Client.submit takes them. threads: default one a core; values do not depend on it. Raises Refused
    with a pointer into the document, JobFailed, JobDismissed (the program was interrupted), TimedOut after `timeout`
    seconds, Unreachable if there is no such program.

    >>> table = gonio.run(surface=surface, material=material, measure=measure, program=program)
    >>> table.dims
    ('theta_i', 'phi_i', 'theta_o', 'phi_o', 'channel')
    """
    return _run(job, members, program, threads, progress, timeout, read_table)


def run_projection(job: JobDocument | None = None, /, *, program: str = "gonio", threads: int | None = None,
                   progress: Progress = False, timeout: float | None = None, **members: Any) -> Projection:
    """Runs a job whose measure has a member "project" by `gonio run`. As run() else.

    >>> sparse = {"kind": "brdf", "incident": measure["incident"], "project": {"order": 4, "samples": 100}}
    >>> quick = {"samples": {"replicates": 4}}
    >>> projection = gonio.run_projection(surface=surface, material=material, measure=sparse, accuracy=quick, program=program)
    >>> projection.f(0, 0, 30, 0).shape
    ()
    """
    return _run(job, members, program, threads, progress, timeout, read_projection)


def _run(job: JobDocument | None, members: dict[str, Any], program: str, threads: int | None, progress: Progress,
         timeout: float | None, read: Callable[[str], Result]) -> Result:
    document = read_document(job, members)
    document["output"] = [{"format": "json", "path": "result.json"}]
    with tempfile.TemporaryDirectory(prefix="gonio_") as folder:
        _run_document(document, folder, program, threads, progress, timeout)
        return read(f"{folder}/result.json")


def run_files(folder: str | os.PathLike[str], job: JobDocument | None = None, /, *, program: str = "gonio",
              threads: int | None = None, progress: Progress = False, timeout: float | None = None,
              **members: Any) -> list[Path]:
    """Runs a job of any kind by `gonio run` and returns the files of its `output`, below `folder`.

    The other parameters, and what is raised, are those of run. read_arrays reads BTFs, light fields and maps.
    """
    document = read_document(job, members)
    answer = _run_document(document, folder, program, threads, progress, timeout)
    return [Path(output["path"]) for output in json.loads(answer)["outputs"]]


def _run_document(document: dict[str, Any], folder: str | os.PathLike[str], program: str, threads: int | None,
                  progress: Progress, timeout: float | None) -> str:
    """What the program prints."""
    with tempfile.TemporaryDirectory(prefix="gonio_") as inputs:
        surface = document.get("surface")
        if isinstance(surface, dict) and isinstance(surface.get("grid"), np.ndarray):
            surface["file"] = f"{inputs}/grid.npy"
            with open(surface["file"], "wb") as file:
                write_array(surface.pop("grid"), file, "/surface/grid")
        path = Path(inputs, "job.json")
        path.write_text(document_text(document))
        command = [program, "run", str(path), "-o", os.fspath(folder), "--json"]
        return _execute(command + (["--threads", str(threads)] if threads else []), progress, timeout)


def _execute(command: list[str], progress: Progress, timeout: float | None) -> str:
    with tempfile.TemporaryFile("w+") as answer:
        try:
            process = subprocess.Popen(command, stdout=answer, stderr=subprocess.PIPE, text=True, errors="replace")
        except OSError as error:
            raise Unreachable(f"{command[0]}: {error.strerror}", retry=False) from error
        timed_out = threading.Event()

        def stop() -> None:
            timed_out.set()
            process.terminate()

        timer = threading.Timer(timeout or 0, stop)
        if timeout is not None:
            timer.start()
        try:
            with process:
                try:
                    assert process.stderr
                    last_words = _follow(process.stderr, progress)
                except BaseException:
                    process.terminate()
                    process.wait()  # before its stderr is closed, so that it ends in its own way
                    raise
        finally:
            timer.cancel()
        answer.seek(0)
        if process.returncode == 0:
            return answer.read()
        if timed_out.is_set():
            raise TimedOut(f"{timeout} s are over")
        raise _failure(process.returncode, answer.read(), last_words)


def _follow(stderr: IO[str], progress: Progress) -> str:
    """Reports progress until the program ends; its last line."""
    show = progress_callback(progress)
    line = ""
    for line in stderr:
        if found := re.fullmatch(r"gonio: (\d+) %  (.*)\n", line):
            show(Status("", "running", found[2], int(found[1])))
    return line.strip()


def _failure(code: int, answer: str, last_words: str) -> GonioError:
    if code < 0:
        return JobFailed(f"the program was ended by signal {-code}")
    try:
        failure = json.loads(answer)
    except ValueError:  # wrong usage is told to people alone
        return Refused(last_words, "usage") if code == 2 else JobFailed(last_words or f"exit code {code}")
    if failure["code"] == "cancelled":
        return JobDismissed("the program was interrupted")
    if failure["code"] not in REFUSALS:
        return JobFailed(failure["message"], problem=failure)
    pointer = failure["field"] if failure["field"].startswith("/") else ""
    return Refused(failure["message"].removeprefix(pointer).removeprefix(" = "), failure["code"], pointer)
