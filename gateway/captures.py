"""Captures of a serial line that other programs made: who said what, and when, as far as the file tells.

Known are our own recordings, pyserial's ``spy://`` logs, ``socat -x`` (with or without ``-v``) and, failing that, the
bare bytes of one direction.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from gateway.errors import UserError
from gateway.recording import is_recording, read


class Chunk(NamedTuple):
    """Bytes that passed: ``at`` in seconds (None: not told), ``arrow`` ``>`` to the mount or ``<`` from it."""

    at: float | None
    side: str
    arrow: str
    data: bytes


_SPY = re.compile(r"(\d+\.\d+) (TX|RX)\s+[0-9A-F]{4}  ([0-9A-F]{2}(?: {1,2}[0-9A-F]{2}){0,15})")
_SOCAT = re.compile(r"([<>]) (\d+/\d+/\d+) (\d+):(\d+):(\d+\.\d+)\s+length=\d+")
_HEX = re.compile(r"((?: [0-9a-f]{2})+)")


def chunks(path: Path) -> list[Chunk]:
    """Everything in a capture, in order. Raises UserError when the file cannot be read."""
    if is_recording(path):
        return [Chunk(event.at, event.side, event.arrow, event.data) for event in read(path).events]
    data = path.read_bytes()
    text = data.decode("latin-1")
    found = _spy(text) or _socat(text)
    if found:
        return found
    if not data:
        raise UserError(f"{path}: the file is empty")
    return [Chunk(None, "client", ">", data)]


def _spy(text: str) -> list[Chunk]:
    """pyserial's ``spy://``: ``000000.002 TX   0000  3A 47 52 23  :GR#``."""
    return [Chunk(float(at), "client", ">" if way == "TX" else "<", bytes.fromhex(octets))
            for at, way, octets in _SPY.findall(text)]


def _socat(text: str) -> list[Chunk]:
    """``socat -x``: a line with the direction and the time, then lines of bytes; the first side is the client."""
    found: list[Chunk] = []
    for line in text.splitlines():
        head = _SOCAT.match(line)
        if head:
            hours, minutes, seconds = int(head.group(3)), int(head.group(4)), float(head.group(5))
            found.append(Chunk(hours * 3600 + minutes * 60 + seconds, "client", head.group(1), b""))
        elif found:
            octets = _HEX.match(line)
            if octets:
                found[-1] = found[-1]._replace(data=found[-1].data + bytes.fromhex(octets.group(1)))
    return found
