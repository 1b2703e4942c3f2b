"""What all pages are sent at one moment, as text that is made once, however many pages there are.

A page that has the frame before gets the ``changes``; one that has come anew, or was behind, gets the ``whole``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import msgspec
from msgspec import Struct

from gateway.console.shown.mount import Sample

#: A mount as pages see it.
State = Mapping[str, Any]
#: Answer times by the mount's number.
Times = Mapping[str, Sequence[Sample]]


class Content(Struct, frozen=True):
    """The mounts, their recordings, and all answer times that are kept."""

    mounts: Sequence[State] = ()
    recordings: Sequence[Any] = ()
    times: Times = {}


class Frame:
    """``number`` counts frames. ``rows`` of the conversation are new ones, and ``row`` is the number of the first."""

    def __init__(self, number: int, content: Content, changes: str, rows: Sequence[Any] = (), row: int = 0) -> None:
        self.number, self.changes, self.rows, self.row = number, changes, rows, row
        self._content = content

    @cached_property
    def whole(self) -> str:
        """Everything, for a page that knows nothing."""
        content = self._content
        state = {"mounts": content.mounts, "recordings": content.recordings}
        return _text({"state": state, **_line(content.times)})

    @cached_property
    def talk(self) -> str:
        """The new rows, empty where there are none."""
        return talk(self.rows)


def talk(rows: Sequence[Any]) -> str:
    """Rows of the conversation, as a page takes them."""
    return _text({"talk": rows}) if rows else ""


def changes(before: Content, after: Content, times: Times) -> str:
    """What is other than before, and the answer times that are ``times`` new; empty where all is as it was."""
    diff: dict[str, Any] = {}
    if mounts := _differences(before.mounts, after.mounts):
        diff["mounts"] = mounts
    if before.recordings != after.recordings:
        diff["recordings"] = after.recordings
    message = ({"diff": diff} if diff else {}) | _line(times)
    return _text(message) if message else ""


def _text(message: Any) -> str:
    return msgspec.json.encode(message).decode()


def _line(times: Times) -> dict[str, Times]:
    found = {index: samples for index, samples in times.items() if samples}
    return {"line": found} if found else {}


def _differences(old: Sequence[State], new: Sequence[State]) -> dict[str, State]:
    """Of every mount the keys whose values are other ones, by the mount's number."""
    found: dict[str, State] = {}
    for index, (before, after) in enumerate(zip(old, new, strict=True)):
        changed = {key: value for key, value in after.items() if before.get(key) != value}
        if changed:
            found[str(index)] = changed
    return found
