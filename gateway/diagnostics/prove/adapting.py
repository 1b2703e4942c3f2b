"""Adapts a ``gateway.toml`` to what was measured: the new text, and the lines that change in it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import tomli

from gateway.app.config import read_tables
from gateway.app.config.source import line_of


def adapted(path: Path | None, keys: Mapping[str, object]) -> tuple[str, list[str]]:
    """Return the text of a file with these keys of its only mount, and the lines that change, with + and -.

    The text is empty without a file, and if its lines cannot be changed one by one. Raises UserError.
    """
    text, changes = read_tables(path)[1].text if path else "", list[str]()
    for key, value in keys.items():
        at, there = (line_of(text, ("mount", name)) or line_of(text, ("mount", 0, name)) for name in ("at", key))
        lines, line = text.split("\n"), f"{key} = {json.dumps(value)}"
        if there:
            changes.append(f"- {lines[there - 1]}")
            lines[there - 1] = line
        elif at:
            lines.insert(at, line)
        changes.append(f"+ {line}")
        text = "\n".join(lines) if at else ""
    try:
        mount = tomli.loads(text).get("mount", {})
    except tomli.TOMLDecodeError:  # the old value had several lines
        return "", changes
    [only] = mount if isinstance(mount, list) else [mount]
    return (text if keys.items() <= only.items() else ""), changes
