"""Decode a capture of a serial line as a conversation: every command named, every reply parsed, in order of time.

Supported are our own recordings, logs of pyserial's ``spy://`` and of ``socat -x`` (with or without ``-v``), and raw
bytes of a direction. A capture is read in pieces, so that memory use does not depend on its length. Commands are
split as a surface does it, replies as a driver does it: according to the commands that they answer.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, groupby
from pathlib import Path
from typing import NamedTuple

from gateway.app.recording.format import LONGEST_LINE, Recording, is_recording, read
from gateway.core.errors import UserError
from gateway.diagnostics.log.conversation import Side
from gateway.diagnostics.log.layout import Row, plain
from gateway.diagnostics.log.printing import happened

#: Bytes that are read from a file at once, and bytes of client data that suffice to recognise the protocol.
PIECE = 16_384
_SPY = re.compile(rb"(\d+\.\d+) (TX|RX)\s+[0-9A-F]{4}  ([0-9A-F]{2}(?: {1,2}[0-9A-F]{2}){0,15})")
_SOCAT = re.compile(rb"([<>]) (\d+/\d+/\d+) (\d+):(\d+):(\d+\.\d+)\s+length=\d+")
_HEX = re.compile(rb"((?: [0-9a-f]{2})+)")
_COMMANDS = re.compile(rb":[^#\r\n]{1,24}#")
#: How many unknown commands of a connection are shown.
NOISE = 1000
#: How many bytes decide whether a capture is a conversation.
ENOUGH = 4096


class Chunk(NamedTuple):
    """Captured bytes: ``at`` in seconds (None if unknown), ``arrow`` is ``>`` to the mount or ``<`` from it."""

    at: float | None
    side: str
    arrow: str
    data: bytes


class Capture:
    """A capture. ``recording`` is set if it is a recording of ours; ``bare`` if it consists of raw bytes only.

    Raises UserError if the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.recording: Recording | None = read(path) if is_recording(path) else None
        self._kind = "" if self.recording is not None else _kind(path)
        self.bare = self.recording is None and not self._kind
        if self.bare and not path.stat().st_size:
            raise UserError(f"{path}: the file is empty")

    def __iter__(self) -> Iterator[Chunk]:
        """Yield everything in it, in order. Raises UserError for an invalid line of a recording."""
        if self.recording is not None:
            return (Chunk(*event) for event in self.recording)
        return _bare(self._path) if self.bare else _spy(self._path) if self._kind == "spy" else _socat(self._path)

    def sample(self) -> bytes:
        """Return the first bytes that clients sent."""
        sent = b""
        for chunk in self:
            if chunk.arrow == ">":
                sent += chunk.data
                if len(sent) >= PIECE:
                    break
        return sent[:PIECE]


def is_text(sent: bytes) -> bool:
    """Whether bytes are ordinary text rather than the commands of a program."""
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
    """Return which tool wrote the capture, ``spy`` or ``socat``; empty if no line looks like either."""
    return next(
        ("spy" if _SPY.search(line) else "socat" for line in _lines(path) if _SPY.search(line) or _SOCAT.match(line)),
        "",
    )


def _spy(path: Path) -> Iterator[Chunk]:
    """Read a log of pyserial's ``spy://``: ``000000.002 TX   0000  3A 47 52 23  :GR#``."""
    for line in _lines(path):
        for at, way, octets in _SPY.findall(line):
            yield Chunk(float(at), "client", ">" if way == b"TX" else "<", bytes.fromhex(octets.decode()))


def _socat(path: Path) -> Iterator[Chunk]:
    """Read a log of ``socat -x``: a line with direction and time, then lines of bytes; the first side is the client."""
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


class NoConversation(UserError):
    """The capture contains no conversation between a client and a mount."""


def decode(chunks: Iterable[Chunk], of: Callable[[str], Side], began: float | None) -> Iterator[str]:
    """Yield lines of text. ``of`` takes a connection's name and returns its decoder; ``began`` is in Unix seconds.

    Only the first ``NOISE`` unknown commands are shown. Raises NoConversation if most of a capture without times is
    unknown.
    """
    talks: dict[str, Side] = {}
    for chunk in chunks:
        if chunk.side not in talks or chunk.arrow in "+~":
            talks[chunk.side] = of(chunk.side)
        side = talks[chunk.side]
        if chunk.arrow not in "<>":
            if chunk.arrow == "-":
                yield from _left_out(talks.pop(chunk.side), chunk, began)
            text = chunk.data.decode("latin-1")
            yield _line(chunk, began, b"", happened(chunk.arrow, text))
            continue
        pieces = side.commands(chunk.data, chunk.at) if chunk.arrow == ">" else side.replies(chunk.data)
        lines = [
            _line(chunk, began, heard.data, heard.text)
            for heard in pieces
            if heard.command or chunk.arrow == "<" or side.unknown <= NOISE
        ]
        if chunk.at is None and side.heard >= ENOUGH and side.understood < side.heard / 2:
            raise NoConversation(
                f"this is no conversation in the {side.protocol} protocol: of its first {side.heard} "
                f"bytes only {side.understood} are commands; if it is in the other protocol, name that "
                "with --protocol"
            )
        yield from lines
    for name, left in talks.items():
        yield from _left_out(left, Chunk(None, name, "!", b""), began)


def _left_out(side: Side, chunk: Chunk, began: float | None) -> Iterator[str]:
    """Say how many unknown commands were not shown."""
    if side.unknown > NOISE:
        yield _line(
            chunk._replace(arrow="!"),
            began,
            b"",
            f"{side.unknown - NOISE} more unknown commands (not in the {side.protocol} protocol) are not shown",
        )


def folded(lines: Iterable[str]) -> Iterator[str]:
    """Replace repeated lines by one line and a count; without times, repetitions carry no information."""
    for line, same in groupby(lines):
        yield line
        times = sum(1 for _ in same) - 1
        if times:
            yield line if times == 1 else f"    the same {times} times more"


def _line(chunk: Chunk, began: float | None, data: bytes, text: str) -> str:
    row = Row((chunk.at or 0.0) + (began or 0.0), chunk.side, chunk.arrow, data, text)
    return plain(row, timed=chunk.at is not None)
