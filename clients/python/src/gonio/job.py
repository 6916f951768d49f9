"""A job on a server."""
from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from .download import Output, download
from .errors import ApiError, ChecksumError, JobDismissed, JobFailed, Refused, Unreachable
from .events import parse_events
from .status import Progress, Status, progress_callback
from .table import Table
from .projection import Projection, parse_projection
from .table_files import parse_table
from .transport import Transport


class Job:
    """A job that a server has accepted. It lives there: losing this object, or the connection, changes nothing.

    id: its name; client.job(id) finds it again. last: the status that was seen last.
    """

    def __init__(self, transport: Transport, last: Status) -> None:
        self._transport = transport
        self.id = last.id
        self.last = last

    def __repr__(self) -> str:
        return f"<gonio.Job {self.id}: {self.last.status}>"

    def status(self) -> Status:
        """Asks the server."""
        return self._seen(self._transport.json("GET", f"jobs/{self.id}"))

    def events(self) -> Iterator[Status]:
        """Each change of the status as it happens; the last one is final. A broken stream is taken up again."""
        return self._follow(None)

    def wait(self, timeout: float | None = None, progress: Progress = False) -> Job:
        """Returns this job once it has succeeded.

        progress: True prints to stderr, a callable gets each Status. Raises JobFailed, JobDismissed, TimedOut after
        `timeout` seconds, and Unreachable once the server has been away for longer than the client's patience: the
        job goes on then, and may be waited for again.
        """
        show = progress_callback(progress)
        if not self.last.is_final:
            for status in self._follow(None if timeout is None else time.monotonic() + timeout):
                show(status)
        if self.last.status == "failed":
            raise JobFailed(self.last.message, self.id, self.last.info.get("problem"))
        if self.last.status == "dismissed":
            raise JobDismissed(f"job {self.id} was cancelled")
        return self

    def cancel(self) -> Status:
        """Stops the job and returns what became of it: one that had ended already stays as it is."""
        return self._seen(self._transport.json("DELETE", f"jobs/{self.id}"))

    def document(self) -> dict[str, Any]:
        """The job document as it was accepted: to look at, or to submit again with some members changed."""
        return dict(self._transport.json("GET", f"jobs/{self.id}/document"))

    def outputs(self) -> list[Output]:
        """The files of a successful job. Raises ApiError while there are none."""
        results = self._transport.json("GET", f"jobs/{self.id}/results")
        return [Output(name, parse_qs(urlsplit(entry["href"]).query)["f"][0], entry["type"], entry["sha256"],
                       entry["bytes"], entry["href"])
                for name, entries in results.items() for entry in entries]

    def table(self) -> Table:
        """The table of a successful job."""
        return parse_table(self.read("table", "json"))

    def projection(self) -> Projection:
        """What a successful job whose measure has a member "project" gives."""
        return parse_projection(self.read("projection", "json"))

    def report(self) -> dict[str, Any]:
        """What was chosen, skipped and counted, the error reached, the surface's statistics, warnings."""
        report: dict[str, Any] = json.loads(self.read("report", "json"))
        return report

    def read(self, output: str, format: str) -> bytes:
        """The bytes of an output, with their checksum compared."""
        wanted = self._output(output, format)

        def attempt() -> bytes:
            with self._transport.open("GET", wanted.href) as reply:
                content = reply.read()
            return content

        content = self._transport.retry(attempt)
        found = hashlib.sha256(content).hexdigest()
        if found != wanted.sha256:
            raise ChecksumError(f"{wanted.href}: SHA-256 {found}: must be {wanted.sha256}")
        return content

    def fetch(self, path: str | os.PathLike[str], output: str = "table", format: str | None = None) -> Path:
        """Writes an output to a file, whole or not at all, and returns its path.

        format: "csv", "json", "exr"; by default that of the file's ending. A download that breaks goes on where it
        was, also in a later call; what is there already is not fetched again. Raises ChecksumError, and OSError of
        the local disk.
        """
        target = Path(path)
        download(self._transport, self._output(output, format or target.suffix.removeprefix(".")), target)
        return target

    def _output(self, name: str, format: str) -> Output:
        outputs = self.outputs()
        for output in outputs:
            if (output.name, output.format) == (name, format):
                return output
        there = ", ".join(f"{output.name} as {output.format}" for output in outputs)
        raise Refused(f"{name} as {format or 'a file without an ending'}: job {self.id} has {there}", "usage")

    def _follow(self, deadline: float | None) -> Iterator[Status]:
        backoff = self._transport.backoff(deadline)
        last_id = ""
        while True:
            headers = {"Accept": "text/event-stream"} | ({"Last-Event-ID": last_id} if last_id else {})
            try:
                with self._transport.open("GET", f"jobs/{self.id}/events", None, headers, deadline) as reply:
                    for event in parse_events(reply.lines()):
                        backoff.progressed()
                        last_id = event.id or last_id
                        yield self._seen(json.loads(event.data))
                        if self.last.is_final:
                            return
                raise Unreachable(f"{reply.url}: the events ended before the job")
            except (ApiError, Unreachable) as error:
                backoff.pause(error)
                if isinstance(error, ApiError):  # as many streams as it allows: it can still be asked
                    yield self._seen(self._transport.json("GET", f"jobs/{self.id}", deadline=deadline))
                    if self.last.is_final:
                        return
                    backoff.progressed()

    def _seen(self, info: dict[str, Any]) -> Status:
        self.last = Status.from_json(info)
        return self.last
