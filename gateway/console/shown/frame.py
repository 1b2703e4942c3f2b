"""A frame: the messages that all pages are sent at one moment, encoded once, however many pages there are.

A page that has the previous frame gets the ``changes``; a new one, or one that was behind, gets the ``whole``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import msgspec
from msgspec import Struct

from gateway.console.shown.mount import Sample

#: The state of a mount as sent to pages.
State = Mapping[str, Any]
#: Samples of the answer time by the mount's number.
Times = Mapping[str, Sequence[Sample]]


class Content(Struct, frozen=True):
    """The states of the mounts, their recordings, and all stored answer times."""

    mounts: Sequence[State] = ()
    recordings: Sequence[Any] = ()
    times: Times = {}


class Frame:
    """One frame. ``number`` counts frames; ``rows`` are new rows of the conversation, ``row`` numbers the first."""

    def __init__(self, number: int, content: Content, changes: str, rows: Sequence[Any] = (), row: int = 0) -> None:
        self.number, self.changes, self.rows, self.row = number, changes, rows, row
        self._content = content

    @cached_property
    def whole(self) -> str:
        """The whole state as a message, for a new page."""
        content = self._content
        state = {"mounts": content.mounts, "recordings": content.recordings}
        return _encoded({"state": state, **_line(content.times)})

    @cached_property
    def talk(self) -> str:
        """The new rows as a message; empty if there are none."""
        return talk(self.rows)


def talk(rows: Sequence[Any]) -> str:
    """Encode rows of the conversation as a message; empty if there are none."""
    return _encoded({"talk": rows}) if rows else ""


def changes(before: Content, after: Content, times: Times) -> str:
    """Encode the differences and the new answer times ``times`` as a message; empty if nothing has changed."""
    diff: dict[str, Any] = {}
    if mounts := _differences(before.mounts, after.mounts):
        diff["mounts"] = mounts
    if before.recordings != after.recordings:
        diff["recordings"] = after.recordings
    message = ({"diff": diff} if diff else {}) | _line(times)
    return _encoded(message) if message else ""


def _encoded(message: Any) -> str:
    return msgspec.json.encode(message).decode()


def _line(times: Times) -> dict[str, Times]:
    found = {index: samples for index, samples in times.items() if samples}
    return {"line": found} if found else {}


def _differences(old: Sequence[State], new: Sequence[State]) -> dict[str, State]:
    """Return the changed keys of every mount with their new values, by the mount's number."""
    found: dict[str, State] = {}
    for index, (before, after) in enumerate(zip(old, new, strict=True)):
        changed = {key: value for key, value in after.items() if before.get(key) != value}
        if changed:
            found[str(index)] = changed
    return found
