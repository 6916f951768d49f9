"""The status of a job, and showing it while somebody waits."""
from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TextIO

FINAL = ("successful", "failed", "dismissed")


@dataclass(frozen=True)
class Status:
    """What the server said about a job.

    status: "accepted", "running", "successful", "failed" or "dismissed". progress: percent. relative_error: reached
    so far; seconds_left: an estimate; both None where not known. info: all that the server said.
    """

    id: str
    status: str
    message: str = ""
    progress: int = 0
    relative_error: float | None = None
    seconds_left: float | None = None
    info: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_json(cls, info: Mapping[str, Any]) -> Status:
        return cls(str(info["jobID"]), str(info["status"]), str(info.get("message") or ""),
                   int(info.get("progress") or 0), info.get("relative_error"), info.get("seconds_left"), info)

    @property
    def is_final(self) -> bool:
        return self.status in FINAL

    def __str__(self) -> str:
        text = f"{self.progress:3d} %  {self.message or self.status}"
        if self.relative_error is not None:
            text += f", error {self.relative_error:.2g}"
        if self.seconds_left is not None:
            text += f", {self.seconds_left:.0f} s left"
        return text


Progress = bool | Callable[[Status], None]


def progress_callback(progress: Progress) -> Callable[[Status], None]:
    """The callable itself; for True one that prints to stderr; for False one that does nothing."""
    if progress is True:
        return _Printer(sys.stderr)
    return progress or _silent


def _silent(status: Status) -> None:
    pass


class _Printer:
    """One line, rewritten, on a terminal; elsewhere a line for every tenth."""

    def __init__(self, out: TextIO) -> None:
        self.out = out
        self.is_terminal = out.isatty()
        self.tenth = -1

    def __call__(self, status: Status) -> None:
        if self.is_terminal:
            self.out.write(f"\r\x1b[K{status}" + ("\n" if status.is_final else ""))
            self.out.flush()
        elif status.progress // 10 > self.tenth or status.is_final:
            self.tenth = status.progress // 10
            print(status, file=self.out)
