"""Reader for the conversations in ``tests/conformance/transcripts``; it imports nothing from the product.

Each line is one of five things: ``;;`` a comment, ``>`` a packet from the client, ``<`` everything that must have been
replied since the last ``<`` (alone: nothing), ``@`` seconds that pass, ``!`` something to be set up. Bytes are written
as in ``tests/conformance/manual``: ``\\xHH`` is one byte, everything else is itself, and a trailing blank is ``\\x20``.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from tests.support.manual_files import raw

FOLDER = Path(__file__).parents[1] / "conformance" / "transcripts"
#: What ``!`` may set before the conversation begins; every other ``!`` line is carried out where it stands.
SETTINGS = ("model", "version", "precision", "sync_text", "connections")


class Line(NamedTuple):
    """One line: its number in the file, its mark, and its bytes (``>`` and ``<``) or its text."""

    number: int
    mark: str
    data: bytes
    text: str


class Conversation(NamedTuple):
    """A whole file: the settings at its head, and its lines."""

    settings: dict[str, str]
    lines: list[Line]


def read(path: Path) -> Conversation:
    """Parse a file. Raises ValueError for a line that is none of the five."""
    settings: dict[str, str] = {}
    lines: list[Line] = []
    for number, line in enumerate(path.read_text("utf-8").splitlines(), 1):
        mark, _, text = line.partition(" ")
        if not line or mark == ";;":
            continue
        if mark not in (">", "<", "@", "!"):
            raise ValueError(f"{path.name}:{number}: {line!r}")
        if text != text.strip():
            raise ValueError(f"{path.name}:{number}: a blank at the end is written \\x20")
        name, _, value = text.partition(" ")
        if mark == "!" and name in SETTINGS:
            if lines:
                raise ValueError(f"{path.name}:{number}: {name} belongs to the head of the file")
            settings[name] = raw(value).decode("latin-1")
        else:
            lines.append(Line(number, mark, raw(text), text))
    return Conversation(settings, lines)


def files(pattern: str) -> list[Path]:
    """Return the conversation files whose name matches the pattern, in order."""
    return sorted(FOLDER.glob(pattern))
