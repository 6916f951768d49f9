"""Downloads that go on where they broke and end only with the right bytes."""
from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from .errors import ApiError, ChecksumError, Unreachable
from .transport import Transport

BLOCK = 1 << 18


@dataclass(frozen=True)
class Output:
    """A file that a finished job offers. format: "csv", "json", ...; size in bytes."""

    name: str
    format: str
    media_type: str
    sha256: str
    size: int
    href: str


def download(transport: Transport, output: Output, path: Path) -> None:
    """Writes an output to `path`, whole or not at all.

    The bytes gather in a hidden file beside it, named after their SHA-256, where a later call goes on. Raises
    ChecksumError, ApiError, Unreachable.
    """
    if path.is_file() and path.stat().st_size == output.size and _sha256(path) == output.sha256:
        return
    part = path.with_name(f".{path.name}.{output.sha256[:16]}.part")
    resumed = part.exists()
    _complete(transport, output, part)
    if resumed and _sha256(part) != output.sha256:  # what a crash left there may be anything
        part.unlink()
        _complete(transport, output, part)
    found = _sha256(part)
    if found != output.sha256:
        part.unlink()
        raise ChecksumError(f"{output.href}: SHA-256 {found}: must be {output.sha256}")
    os.replace(part, path)


def _complete(transport: Transport, output: Output, part: Path) -> None:
    backoff = transport.backoff()
    with open(part, "ab") as file:
        while file.tell() < output.size:
            begin = file.tell()
            try:
                _attempt(transport, output, file)
            except (ApiError, Unreachable) as error:
                if file.tell() > begin:
                    backoff.progressed()
                backoff.pause(error)
        file.flush()
        os.fsync(file.fileno())


def _attempt(transport: Transport, output: Output, file: BinaryIO) -> None:
    """Appends what is missing, as far as the connection holds."""
    have = file.tell()
    headers = {"Range": f"bytes={have}-", "If-Range": f'"{output.sha256}"'} if have else {}
    with transport.open("GET", output.href, headers=headers) as reply:
        if have and not reply.headers.get("Content-Range", "").startswith(f"bytes {have}-"):
            file.seek(0)  # all of it again
            file.truncate()
        while block := reply.read(BLOCK):
            file.write(block)
    if file.tell() < output.size:
        raise Unreachable(f"{reply.url}: cut off after {file.tell()} of {output.size} bytes")


def _sha256(path: Path) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
