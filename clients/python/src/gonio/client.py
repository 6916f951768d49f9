"""The service, as a Python program sees it."""
from __future__ import annotations

import hashlib
import os
import tempfile
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast
from urllib.parse import urlencode

import numpy as np
import numpy.typing as npt

from .document import JobDocument, document_text, file_members, read_document, write_array
from .errors import ApiError, Refused
from .job import Job
from .status import Progress, Status
from .table import Table
from .transport import Body, Transport, json_body


class Client:
    """A gonio server.

    url: of the server, as `gonio serve` prints it. token, or token_file with it as the last word of its first line,
    if the server wants one. timeout: seconds of silence after which a request counts as broken. patience: seconds for
    which a request that broke, or that the server put off (429, 502, 503, 504), is tried again. Raises Refused.

    >>> with gonio.Client(url) as client:
    ...     job = client.submit(surface=surface, material=material, measure=measure)
    ...     job.wait(timeout=60).table().values.shape
    (1, 1, 3, 1, 1)
    """

    def __init__(self, url: str, token: str | None = None, token_file: str | os.PathLike[str] | None = None,
                 timeout: float = 60, patience: float = 60) -> None:
        if token_file is not None:
            token = _read_token(Path(token_file))
        self._transport = Transport(url, token, timeout, patience)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is kept open between calls, so there is nothing to end."""

    def upload(self, source: npt.ArrayLike | str | os.PathLike[str], **members: Any) -> dict[str, Any]:
        """Uploads a surface, unless the server has it, and returns it as the member `surface` of a job document.

        source: a file that gonio reads, or a 2-D array of heights with row 0 at y = 0. members: the other keys of
        the document's surface, such as width="50 mm", pitch="1 um", height_scale="1 um", boundary="open".

        >>> relief = client.upload(np.zeros((16, 16)), pitch="1 um", height_scale="1 um")
        >>> sorted(relief)
        ['height_scale', 'pitch', 'sha256']
        """
        if isinstance(source, (str, os.PathLike)):
            return {"sha256": self._upload_file(Path(source)), **members}
        with tempfile.NamedTemporaryFile(suffix=".npy") as file:
            write_array(source, cast(BinaryIO, file))
            file.flush()
            return {"sha256": self._upload_file(Path(file.name)), **members}

    def submit(self, job: JobDocument | None = None, /, *, process: str | None = None, key: str | None = None,
               **members: Any) -> Job:
        """Hands in a job: a document (a mapping or the path of a JSON file), members given by name, or both.

        A surface given as a file or as an array (`grid`) is uploaded, and so are maps of the material and of the
        environment; `output` is left out, for outputs are fetched. process: by default that of the kind of measurement.
        However often this has to be tried, it makes one job. key: an Idempotency-Key of one's own: the same again,
        even from another process, is the same job. Raises ApiError with a pointer to what is wrong.

        >>> client.submit(surface=surface, material={"model": "lambertian", "albedo": 2}, measure=measure)
        Traceback (most recent call last):
        gonio.errors.ApiError: /material/albedo: 2: must be a number from 0 to 1
        """
        document = read_document(job, members)
        document.pop("output", None)
        for files in file_members(document):
            for name in ("file", "files", "grid"):
                value = files.get(name)
                if isinstance(value, (str, np.ndarray)):
                    files |= self.upload(files.pop(name))
                elif name == "files" and isinstance(value, list):
                    files["sha256"] = [self.upload(path)["sha256"] for path in files.pop(name)]
        if process is None:
            measure = document.get("measure")
            process = str(measure.get("kind", "brdf")) if isinstance(measure, Mapping) else "brdf"
        body = json_body(document_text({"inputs": document}))
        info = self._transport.json("POST", f"processes/{process}/execution", body,
                                    {"Idempotency-Key": key or uuid.uuid4().hex})
        return Job(self._transport, Status.from_json(info))

    def run(self, job: JobDocument | None = None, /, *, progress: Progress = False, timeout: float | None = None,
            **members: Any) -> Table:
        """Submits, waits, and returns the table: what gonio.run does without a server.

        >>> client.run(surface=surface, material=material, measure=measure).units["values"]
        '1/sr'
        """
        return self.submit(job, **members).wait(timeout, progress).table()

    def job(self, id: str) -> Job:
        """A job that was submitted before. Raises ApiError if there is none."""
        return Job(self._transport, Status.from_json(self._transport.json("GET", f"jobs/{id}")))

    def jobs(self, *, status: str | None = None, process: str | None = None, page: int = 100) -> Iterator[Job]:
        """Jobs, newest first, those of a status ("running", or several: "accepted,running") and process alone.

        >>> [job.last.status for job in client.jobs(status="failed")]
        []
        """
        wanted = {"limit": page, "status": status, "processID": process}
        href = "jobs?" + urlencode({name: value for name, value in wanted.items() if value is not None})
        while href:
            answer = self._transport.json("GET", href)
            for info in answer["jobs"]:
                yield Job(self._transport, Status.from_json(info))
            href = next((link["href"] for link in answer["links"] if link["rel"] == "next"), "")

    def processes(self) -> list[dict[str, Any]]:
        """What the server can compute.

        >>> "brdf" in [process["id"] for process in client.processes()]
        True
        """
        answer = self._transport.json("GET", "processes")
        return list(answer["processes"])

    def process(self, id: str) -> dict[str, Any]:
        """Description of a process: JSON Schemas of its inputs, formats of its outputs."""
        return dict(self._transport.json("GET", f"processes/{id}"))

    def _upload_file(self, path: Path) -> str:
        try:
            with open(path, "rb") as file:
                sha256 = hashlib.file_digest(file, "sha256").hexdigest()
                length = file.tell()
        except OSError as error:
            raise Refused(f"{path}: {error.strerror}", "not_found") from error
        if not self._has(sha256):
            body = Body(lambda: open(path, "rb"), length, "application/octet-stream")
            self._transport.json("PUT", f"surfaces/{sha256}", body)
        return sha256

    def _has(self, sha256: str) -> bool:
        def attempt() -> None:
            with self._transport.open("HEAD", f"surfaces/{sha256}"):
                pass

        try:
            self._transport.retry(attempt)
        except ApiError as error:
            if error.status == 404:
                return False
            raise
        return True


def _read_token(path: Path) -> str:
    try:
        words = path.read_text().split("\n", 1)[0].split()
    except (OSError, ValueError) as error:
        raise Refused(f"token_file {path}: {error}", "usage") from error
    if not words:
        raise Refused(f"token_file {path}: the first line is empty", "usage")
    return words[-1]
