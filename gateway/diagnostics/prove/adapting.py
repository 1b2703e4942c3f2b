"""Adapts a ``gateway.toml`` to what was measured: the new text, and the lines that change in it."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from gateway.app.config import read_tables
from gateway.app.config.source import line_of
from gateway.core.errors import UserError


def written(keys: Mapping[str, object]) -> list[str]:
    """Return the keys as lines of [mount]."""
    return [f"{key} = {json.dumps(value)}" for key, value in keys.items()]


def adapted(path: Path, keys: Mapping[str, object]) -> tuple[str, str]:
    """Return the text of a file before, and with these keys of its only mount. Raises UserError."""
    before = read_tables(path)[1].text
    lines = before.split("\n")
    for key, line in zip(keys, written(keys), strict=True):
        text, places = "\n".join(lines), (("mount",), ("mount", 0))
        at = next((found for place in places if (found := line_of(text, (*place, "at")))), None)
        if at is None:
            raise UserError(f"{path}: it has no mount with a line that begins with at =")
        there = next((found for place in places if (found := line_of(text, (*place, key)))), None)
        lines[(there or at + 1) - 1 : (there or at)] = [line]
    return before, "\n".join(lines)


def difference(before: str, after: str) -> Iterator[str]:
    """Yield the lines that change, with + and -."""
    for line in difflib.ndiff(before.splitlines(), after.splitlines()):
        if line[:2] in ("+ ", "- "):
            yield line
