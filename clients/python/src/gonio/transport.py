"""HTTP with retries: the only module that knows http.client.

Every request of this package may be repeated: GET and HEAD by nature, PUT because surfaces are named by their
content, DELETE because a dismissed job stays dismissed, POST because it carries an Idempotency-Key. So
whatever breaks on the way is tried again, with growing and jittered pauses, for `patience` seconds.
"""
from __future__ import annotations

import contextlib
import email.utils
import http.client
import io
import json
import random
import socket
import ssl
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO, TypeVar
from urllib.parse import urljoin, urlsplit

from .errors import ApiError, Refused, TimedOut, Unreachable

T = TypeVar("T")

RETRIED_STATUSES = (429, 502, 503, 504)
MOST_PROBLEM_BYTES = 1 << 20


@contextlib.contextmanager
def _unreachable(url: str) -> Iterator[None]:
    """Turns what sockets and http.client throw into Unreachable."""
    try:
        yield
    except (OSError, http.client.HTTPException) as error:
        hopeless = isinstance(error, ssl.SSLError) or (
            isinstance(error, socket.gaierror) and error.errno != socket.EAI_AGAIN)
        raise Unreachable(f"{url}: {error or type(error).__name__}", retry=not hopeless) from error


class Backoff:
    """Pauses between attempts: full jitter, doubled from `first` up to `longest` seconds, never shorter than the
    server asked. Gives up where a pause would go beyond `patience` seconds, by raising the error of the attempt, or
    beyond the deadline (on the monotonic clock), by raising TimedOut."""

    first = 0.2
    longest = 10.0

    def __init__(self, patience: float, deadline: float | None = None) -> None:
        self.patience = patience
        self.deadline = deadline
        self.progressed()

    def progressed(self) -> None:
        """Starts anew: an attempt got somewhere."""
        self.attempts = 0
        self.until = time.monotonic() + self.patience

    def pause(self, error: ApiError | Unreachable) -> None:
        asked = 0.0
        if isinstance(error, ApiError):
            if error.status not in RETRIED_STATUSES:
                raise error
            asked = error.retry_after or 0.0
        elif not error.retry:
            raise error
        seconds = asked + random.uniform(0, min(self.longest, self.first * 2**self.attempts))
        self.attempts += 1
        end = time.monotonic() + seconds
        if self.deadline is not None and end > self.deadline:
            raise TimedOut("the time is over") from error
        if end > self.until:
            raise error
        time.sleep(seconds)


@dataclass
class Body:
    """What a request sends: `open` gives it anew for each attempt; `length` in bytes."""

    open: Callable[[], BinaryIO]
    length: int
    media_type: str


@dataclass
class Reply:
    """A response whose body is still to be read. Close it, or use it in a with statement."""

    url: str
    status: int
    headers: http.client.HTTPMessage
    _response: http.client.HTTPResponse
    _socket: socket.socket
    _connection: http.client.HTTPConnection
    _seconds: Callable[[], float]

    def read(self, size: int | None = None) -> bytes:
        """Up to `size` bytes as soon as there are any, b"" at the end; without a size all, checked against
        Content-Length."""
        with _unreachable(self.url):
            return self._response.read() if size is None else self._response.read1(size)

    def lines(self) -> Iterator[bytes]:
        """Lines as they come, until the end of the body or the deadline of the request."""
        while True:
            with _unreachable(self.url):
                self._socket.settimeout(self._seconds())
                line = self._response.readline()
            if not line:
                return
            yield line

    def json(self) -> Any:
        text = self.read()
        try:
            return json.loads(text)
        except ValueError as error:
            raise Unreachable(f"{self.url}: the answer is no JSON: {text[:80]!r}") from error

    def __enter__(self) -> Reply:
        return self

    def __exit__(self, *_: object) -> None:
        self._response.close()
        self._connection.close()


class Transport:
    """Sends requests to one server. A connection a request: any thread may use it, and none is ever stale."""

    def __init__(self, url: str, token: str | None, timeout: float, patience: float) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise Refused(f"url = {url!r}: must be http://HOST[:PORT][/PATH] or https://...", "usage")
        if token is not None and not (token.isascii() and token.isprintable() and " " not in token):
            raise Refused("token: must be one word of ASCII", "usage")
        self.url = url.rstrip("/") + "/"
        self.timeout = timeout
        self.patience = patience
        self._connection_type = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        self._headers = {"Authorization": f"Bearer {token}"} if token else {}

    def absolute(self, href: str) -> str:
        """The URL of a path of the API, or of a link as the server wrote it."""
        return urljoin(self.url, href if "://" in href else href.lstrip("/"))

    def backoff(self, deadline: float | None = None) -> Backoff:
        return Backoff(self.patience, deadline)

    def retry(self, attempt: Callable[[], T], deadline: float | None = None) -> T:
        """The result of the first attempt that works; the error of the last one if patience ends before."""
        backoff = self.backoff(deadline)
        while True:
            try:
                return attempt()
            except (ApiError, Unreachable) as error:
                backoff.pause(error)

    def json(self, method: str, href: str, body: Body | None = None, headers: Mapping[str, str] | None = None,
             deadline: float | None = None) -> Any:
        """The JSON of the answer, retried."""
        def attempt() -> Any:
            with self.open(method, href, body, headers, deadline) as reply:
                return reply.json()

        return self.retry(attempt, deadline)

    def open(self, method: str, href: str, body: Body | None = None, headers: Mapping[str, str] | None = None,
             deadline: float | None = None) -> Reply:
        """One attempt. Raises ApiError for a status from 300 on, Unreachable if there is no answer."""
        def seconds() -> float:
            return self.timeout if deadline is None else max(0.001, min(self.timeout, deadline - time.monotonic()))

        url = self.absolute(href)
        connection = self._connection_type(urlsplit(url).netloc, timeout=seconds())
        try:
            with _unreachable(url):
                connection.connect()
                raw: socket.socket = connection.sock  # the connection forgets it once the response has begun
                _send(connection, method, url, body, {**self._headers, **(headers or {})})
                response = connection.getresponse()
            reply = Reply(url, response.status, response.headers, response, raw, connection, seconds)
            if reply.status >= 300:
                raise _api_error(reply)
            return reply
        except BaseException:
            connection.close()
            raise


def _send(connection: http.client.HTTPConnection, method: str, url: str, body: Body | None,
          headers: dict[str, str]) -> None:
    parts = urlsplit(url)
    target = parts.path + (f"?{parts.query}" if parts.query else "")
    if body is None:
        connection.request(method, target, headers=headers)
        return
    headers |= {"Content-Type": body.media_type, "Content-Length": str(body.length)}
    with body.open() as stream, contextlib.suppress(BrokenPipeError, ConnectionResetError):
        # Suppressed: a server that refuses does not read to the end, and its answer may be there.
        connection.request(method, target, stream, headers)


def json_body(text: str) -> Body:
    content = text.encode()
    return Body(lambda: io.BytesIO(content), len(content), "application/json")


def _api_error(reply: Reply) -> ApiError:
    problem: Any = None
    with reply:
        with contextlib.suppress(Unreachable, ValueError):
            problem = json.loads(reply.read(MOST_PROBLEM_BYTES))
    if not isinstance(problem, dict):  # from something between here and the server
        problem = {"title": f"{reply.status} {http.client.responses.get(reply.status, '')}".strip()}
    return ApiError(reply.status, problem, _retry_after(reply.headers.get("Retry-After")))


def _retry_after(text: str | None) -> float | None:
    """Seconds from now, of a number or a date."""
    if text is None:
        return None
    if text.strip().isdigit():
        return float(text)
    try:
        return max(0.0, email.utils.parsedate_to_datetime(text).timestamp() - time.time())
    except ValueError:
        return None
