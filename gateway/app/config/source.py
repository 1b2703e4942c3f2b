"""Finds where a value of a configuration was written, so that a message can name the line of the file or the flag.

The line is found by the TOML parser itself: the first lines of the text are parsed, one line more each time, until
the result has the key; then the last statement is the key's. This is done only for messages and ``config``.
"""

from __future__ import annotations

from typing import Any

import msgspec
import tomli

#: The path of a key or a table in the configuration, such as ``("mount", 0, "lowest")``.
Place = tuple[str | int, ...]


class Source(msgspec.Struct):
    """The origin of values: a file's name and text, and the flags that were given."""

    name: str
    text: str = ""
    flags: dict[Place, str] = {}
    is_file: bool = False

    def where(self, place: Place) -> str:
        """Return ``--lowest``, ``gateway.toml:12``, or only the file's name. A single mount has number 0 in a path."""
        prefixes = [place[:length] for length in range(len(place), 0, -1)]
        for prefix in prefixes:
            if prefix in self.flags:
                return self.flags[prefix]
        for prefix in prefixes:
            line = line_of(self.text, self._written(prefix)) if self.text else None
            if line is not None:
                return f"{self.name}:{line}"
        return self.name

    def origin(self, place: Place) -> str | None:
        """Return the flag or the line that sets exactly this key; None if it was not set."""
        if place in self.flags:
            return self.flags[place]
        line = line_of(self.text, self._written(place)) if self.text else None
        overridden = any(place[:length] in self.flags for length in range(1, len(place)))
        return None if line is None or overridden else f"{self.name}:{line}"

    def _written(self, place: Place) -> Place:
        """Return the path as in the file, where a single ``[mount]`` has no number."""
        single = place[:2] == ("mount", 0) and isinstance(tomli.loads(self.text).get("mount"), dict)
        return ("mount", *place[2:]) if single else place


def line_of(text: str, place: Place) -> int | None:
    """Return the line, from 1, on which the statement that sets ``place`` begins; None if the text does not set it.

    ``("mount", "lowest")`` is a key, ``("surface", 1)`` the second of several tables. The text must be valid TOML.
    """
    lines = text.split("\n")
    began = 1
    for end in range(1, len(lines) + 1):
        try:
            tables = tomli.loads("\n".join(lines[:end]))
        except tomli.TOMLDecodeError:
            continue  # the text is cut within a statement of several lines
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
