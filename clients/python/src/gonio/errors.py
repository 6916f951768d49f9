"""The errors of this package. Every one is a GonioError; none of http.client, socket or json gets out.

    GonioError
        Refused            what was asked for is not allowed; says where and what would be
            ApiError       the same, or any other error status, from a server
        JobFailed          the job was accepted, computed, and failed
        JobDismissed       somebody cancelled the job
        TimedOut           the time that the caller gave is over; the job goes on
        Unreachable        no server (or no program) answers; says nothing about the job
        ChecksumError      the bytes that arrived are not those that the server has
        InvalidTable       a file is no gonio table
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class GonioError(Exception):
    """Base of all errors of this package."""


class Refused(GonioError):
    """What was asked for is not allowed.

    code: "invalid_input", "missing_unit", "not_found", "limit", "usage", or "" if there is none.
    pointer: JSON pointer of the bad value in the job document, "" if it is about no single value.
    detail: the value and what is allowed.
    """

    def __init__(self, detail: str, code: str = "", pointer: str = "") -> None:
        super().__init__(f"{pointer}: {detail}" if pointer and pointer not in detail else detail)
        self.code = code
        self.pointer = pointer
        self.detail = detail


class ApiError(Refused):
    """The server answered with an error status.

    status: HTTP status. type, title: of the problem document (RFC 9457), which is `problem` as a whole.
    retry_after: seconds after which the server wants to be asked again, None if it did not say.
    """

    def __init__(self, status: int, problem: Mapping[str, Any], retry_after: float | None = None) -> None:
        self.status = status
        self.problem = dict(problem)
        self.type = str(problem.get("type", "about:blank"))
        self.title = str(problem.get("title", ""))
        self.retry_after = retry_after
        errors = problem.get("errors")
        first = errors[0] if isinstance(errors, list) and errors and isinstance(errors[0], dict) else {}
        # The job document is the member "inputs" of the request.
        pointer = str(first.get("pointer", "")).removeprefix("/inputs")
        detail = str(first.get("detail") or problem.get("detail") or self.title or f"HTTP status {status}")
        super().__init__(detail, str(problem.get("code", "")), pointer)


class JobFailed(GonioError):
    """The job was accepted, and its computation failed.

    job: its id ("" of a local run). problem: what the program said: code, field, value, message, if it could.
    """

    def __init__(self, message: str, job: str = "", problem: Mapping[str, Any] | None = None) -> None:
        super().__init__(f"job {job} failed: {message}" if job else message)
        self.job = job
        self.message = message
        self.problem = dict(problem or {})


class JobDismissed(GonioError):
    """The job was cancelled."""


class TimedOut(GonioError):
    """The time that the caller gave is over. The job is as it was: wait again, or cancel it."""


class Unreachable(GonioError):
    """No answer: refused, reset, cut off, timed out, or there is no such host or program.

    retry: whether asking again could help.
    """

    def __init__(self, message: str, retry: bool = True) -> None:
        super().__init__(message)
        self.retry = retry


class ChecksumError(GonioError):
    """The bytes that arrived do not have the SHA-256 that the server gave."""


class InvalidTable(GonioError):
    """A file or text is no gonio table that this version reads."""
