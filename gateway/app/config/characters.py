"""Characters that no name and no path has: a NUL ends one early, an escape sequence rewrites a terminal.

They are refused wherever they are written, before anything is opened or shown.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from gateway.app.config.lines import Place

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")


def control(text: str) -> str:
    """What is wrong with a text, in words; empty when it has no control character."""
    found = _CONTROL.search(text)
    if found is None:
        return ""
    return f"there is a control character (U+{ord(found.group()):04X}) in it; write it without"


def misspelt(tables: object, place: Place = ()) -> Iterator[tuple[Place, str]]:
    """Every text in tables that has a control character, where it is, and what is wrong with it."""
    if isinstance(tables, str):
        if words := control(tables):
            yield place, words
    elif isinstance(tables, dict):
        for key, value in tables.items():
            yield from misspelt(value, (*place, key))
    elif isinstance(tables, list):
        for number, value in enumerate(tables):
            yield from misspelt(value, (*place, number))
