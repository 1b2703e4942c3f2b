"""Captures of a serial line that other programs made: who said what, and when, as far as the file tells.

Known are our own recordings, pyserial's ``spy://`` logs, ``socat -x`` (with or without ``-v``) and, failing that, the
bare bytes of one direction. A capture is read piece by piece: however long it is, it needs no more memory.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from gateway.app.recording.format import LONGEST_LINE, Recording, is_recording, read
from gateway.core.errors import UserError


class Chunk(NamedTuple):
    """Bytes that passed: ``at`` in seconds (None: not told), ``arrow`` ``>`` to the mount or ``<`` from it."""

    at: float | None
    side: str
    arrow: str
    data: bytes


#: Bytes of a file that are looked at together, and of what was sent that tell which protocol it is.
PIECE = 16_384
_SPY = re.compile(rb"(\d+\.\d+) (TX|RX)\s+[0-9A-F]{4}  ([0-9A-F]{2}(?: {1,2}[0-9A-F]{2}){0,15})")
_SOCAT = re.compile(rb"([<>]) (\d+/\d+/\d+) (\d+):(\d+):(\d+\.\d+)\s+length=\d+")
_HEX = re.compile(rb"((?: [0-9a-f]{2})+)")
_COMMANDS = re.compile(rb":[^#\r\n]{1,24}#")


class Capture:
    """A capture: ``recording`` is the recording that it is, or None; ``bare`` tells whether it is bytes and no more.

    Raises UserError when the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.recording: Recording | None = read(path) if is_recording(path) else None
        self._kind = "" if self.recording is not None else _kind(path)
        self.bare = self.recording is None and not self._kind
        if self.bare and not path.stat().st_size:
            raise UserError(f"{path}: the file is empty")

    def __iter__(self) -> Iterator[Chunk]:
        """Everything in it, in order. Raises UserError for what is no line of a recording."""
        if self.recording is not None:
            return (Chunk(*event) for event in self.recording)
        return _bare(self._path) if self.bare else _spy(self._path) if self._kind == "spy" else _socat(self._path)

    def sample(self) -> bytes:
        """The first bytes that were sent by a client."""
        sent = b""
        for chunk in self:
            if chunk.arrow == ">":
                sent += chunk.data
                if len(sent) >= PIECE:
                    break
        return sent[:PIECE]


def is_text(sent: bytes) -> bool:
    """Whether bytes are lines and words that somebody has written, rather than what a program says to a mount."""
    if b"\n" not in sent or b" " not in sent:
        return False
    if any(byte < 32 and byte not in b"\t\r\n\x0c" for byte in sent):
        return False
    return sum(len(command) for command in _COMMANDS.findall(sent)) < len(sent) / 2


def _lines(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while line := file.readline(PIECE):
            yield line


def _kind(path: Path) -> str:
    """Which program made it: ``spy``, ``socat``; empty when no line looks like any."""
    return next(
        ("spy" if _SPY.search(line) else "socat" for line in _lines(path) if _SPY.search(line) or _SOCAT.match(line)),
        "",
    )


def _spy(path: Path) -> Iterator[Chunk]:
    """pyserial's ``spy://``: ``000000.002 TX   0000  3A 47 52 23  :GR#``."""
    for line in _lines(path):
        for at, way, octets in _SPY.findall(line):
            yield Chunk(float(at), "client", ">" if way == b"TX" else "<", bytes.fromhex(octets.decode()))


def _socat(path: Path) -> Iterator[Chunk]:
    """``socat -x``: a line with the direction and the time, then lines of bytes; the first side is the client."""
    chunk: Chunk | None = None
    data = bytearray()
    for line in chain(_lines(path), (b"> 0/0/0 0:0:0.0 length=0",)):
        head = _SOCAT.match(line)
        if (head or len(data) > LONGEST_LINE) and chunk is not None:
            yield chunk._replace(data=bytes(data))
            data.clear()
        if head:
            hours, minutes, seconds = int(head.group(3)), int(head.group(4)), float(head.group(5))
            chunk = Chunk(hours * 3600 + minutes * 60 + seconds, "client", head.group(1).decode(), b"")
        elif chunk is not None and (octets := _HEX.match(line)):
            data += bytes.fromhex(octets.group(1).decode())


def _bare(path: Path) -> Iterator[Chunk]:
    with path.open("rb") as file:
        while data := file.read(PIECE):
            yield Chunk(None, "client", ">", data)
