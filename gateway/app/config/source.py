"""Where every value of a configuration was written, so that a message can name the line of the file or the flag.

The TOML parser itself is asked for a line: the first beginning of the text, cut at a line's end, that has the key ends
with the key's statement. A text is only parsed again like this when something is wrong with it.
"""

from __future__ import annotations

from typing import Any

import msgspec
import tomli

Place = tuple[str | int, ...]


class Source(msgspec.Struct):
    """Where the values come from: a file's name and text, and the flags that were given."""

    name: str
    text: str = ""
    flags: dict[Place, str] = {}

    def where(self, place: Place) -> str:
        """``--lowest``, ``gateway.toml:12``, or the name alone. Places count mounts even where there is just one."""
        ways = [place[:length] for length in range(len(place), 0, -1)]
        for way in ways:
            if way in self.flags:
                return self.flags[way]
        for way in ways:
            line = line_of(self.text, self._written(way)) if self.text else None
            if line is not None:
                return f"{self.name}:{line}"
        return self.name

    def origin(self, place: Place) -> str | None:
        """The flag or the line that sets exactly this; None when nothing does."""
        if place in self.flags:
            return self.flags[place]
        line = line_of(self.text, self._written(place)) if self.text else None
        overridden = any(place[:length] in self.flags for length in range(1, len(place)))
        return None if line is None or overridden else f"{self.name}:{line}"

    def _written(self, place: Place) -> Place:
        """The place as the file has it: a single ``[mount]`` has no number."""
        single = place[:2] == ("mount", 0) and isinstance(tomli.loads(self.text).get("mount"), dict)
        return ("mount", *place[2:]) if single else place


def line_of(text: str, place: Place) -> int | None:
    """The line, from 1, on which the statement that brings ``place`` about begins; None when nothing does.

    ``("mount", "lowest")`` is a key, ``("surface", 1)`` the second of several tables. The text must be valid.
    """
    lines = text.split("\n")
    began = 1
    for end in range(1, len(lines) + 1):
        try:
            tables = tomli.loads("\n".join(lines[:end]))
        except tomli.TOMLDecodeError:
            continue  # the cut is within a statement of several lines
        if _has(tables, place):
            return began
        began = end + 1
    return None


def _has(tables: Any, place: Place) -> bool:
    for step in place:
        try:
            tables = tables[step]
        except (KeyError, IndexError, TypeError):
            return False
    return True
