"""On which line of a TOML text a key is set.

The parser itself is asked: the first beginning of the text, cut at a line's end, that has the key ends with the key's
statement. A text is only parsed again like this when something is wrong with it.
"""

from __future__ import annotations

from typing import Any

import tomli

Place = tuple[str | int, ...]


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
