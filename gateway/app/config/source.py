"""Finds where a value of a configuration was written, so that a message can name the line of the file or the flag.

The line is found by the TOML parser itself: the first lines of the text are parsed, one line more each time, until
the result has the key; then the last statement is the key's. This is done only for messages and ``config``.
"""

from __future__ import annotations

from typing import Any

import msgspec
import tomli

#: The path of a key or a table in the configuration, such as ``("mount", 0, "lowest")``. A single mount has number 0.
Place = tuple[str | int, ...]


class Source(msgspec.Struct):
    """Where values come from: a file (its name and text), and flags by the paths of the keys that they set."""

    name: str
    text: str = ""
    flags: dict[Place, str] = {}
    is_file: bool = False

    def locate(self, key_path: Place) -> str:
        """Return the flag or line (``gateway.toml:12``) that sets a key or else its table; else the file's name."""
        prefixes = [key_path[:length] for length in range(len(key_path), 0, -1)]
        for prefix in prefixes:
            if prefix in self.flags:
                return self.flags[prefix]
        for prefix in prefixes:
            line = line_of(self.text, self._path_in_file(prefix)) if self.text else None
            if line is not None:
                return f"{self.name}:{line}"
        return self.name

    def origin_of(self, key_path: Place) -> str | None:
        """Return the flag or the line that sets exactly this key; None if none does, or a flag replaces its table."""
        if key_path in self.flags:
            return self.flags[key_path]
        line = line_of(self.text, self._path_in_file(key_path)) if self.text else None
        overridden = any(key_path[:length] in self.flags for length in range(1, len(key_path)))
        return None if line is None or overridden else f"{self.name}:{line}"

    def _path_in_file(self, key_path: Place) -> Place:
        """Return the path as in the file, where a single ``[mount]`` has no number."""
        single = key_path[:2] == ("mount", 0) and isinstance(tomli.loads(self.text).get("mount"), dict)
        return ("mount", *key_path[2:]) if single else key_path


def line_of(text: str, key_path: Place) -> int | None:
    """Return the line, from 1, on which the statement that sets ``key_path`` begins; None if the text does not set it.

    ``("mount", "lowest")`` is a key, ``("surface", 1)`` the second of several tables. The text must be valid TOML.
    """
    lines = text.split("\n")
    began = 1
    for end in range(1, len(lines) + 1):
        try:
            tables = tomli.loads("\n".join(lines[:end]))
        except tomli.TOMLDecodeError:
            continue  # the text is cut within a statement of several lines
        if _has_key(tables, key_path):
            return began
        began = end + 1
    return None


def _has_key(tables: Any, key_path: Place) -> bool:
    for step in key_path:
        try:
            tables = tables[step]
        except (KeyError, IndexError, TypeError):
            return False
    return True
