"""Server-sent events (the text/event-stream format of WHATWG HTML, section 9.2)."""
from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """One event. id: of this or the last event of the stream that had one."""

    id: str
    name: str
    data: str


def parse_events(lines: Iterable[bytes]) -> Iterator[Event]:
    """Events as they are complete; one that the stream cuts off is dropped, as the format says. A line that is only
    a comment (the heartbeat) yields nothing."""
    last_id, name = "", ""
    data: list[str] = []
    for raw in lines:
        line = raw.decode("utf-8", "replace").rstrip("\r\n")
        if not line:
            if data:
                yield Event(last_id, name or "message", "\n".join(data))
            name, data = "", []
            continue
        field, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if field == "id":
            last_id = value
        elif field == "event":
            name = value
        elif field == "data":
            data.append(value)
