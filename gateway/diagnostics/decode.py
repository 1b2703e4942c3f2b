"""Decode a capture of a serial line as a conversation: every command named, every reply parsed, in order of time.

Supported are our own recordings, and logs of pyserial's ``spy://`` and of ``socat -x`` (with or without ``-v``). They
are read in pieces, so that memory use does not depend on their length. Commands are split as a surface splits them, and
each reply is parsed according to the command that it answers, as a driver does it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path

from gateway.app.recording.format import MAX_LINE_LENGTH, Event, Recording, is_recording, read
from gateway.core.errors import UserError
from gateway.diagnostics.log.conversation import ConnectionDecoder
from gateway.diagnostics.log.layout import Row, as_one_line
from gateway.diagnostics.log.printing import describe_event

#: How many bytes are read from a file at once; so many bytes of client data suffice to recognise the protocol.
CHUNK_BYTES = 16_384
_SPY_LINE = re.compile(rb"(\d+\.\d+) (TX|RX)\s+[0-9A-F]{4}  ([0-9A-F]{2}(?: {1,2}[0-9A-F]{2}){0,15})")
_SOCAT_HEADER = re.compile(rb"([<>]) (\d+/\d+/\d+) (\d+):(\d+):(\d+\.\d+)\s+length=\d+")
_SOCAT_BYTES = re.compile(rb"((?: [0-9a-f]{2})+)")


class Capture:
    """A file with captured serial data; ``recording`` is None unless ``run --record`` wrote it. Raises UserError if the
    file cannot be read or is not a capture.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.recording: Recording | None = read(path) if is_recording(path) else None
        self._format = "" if self.recording is not None else _capture_format(path)
        if self.recording is None and not self._format:
            raise UserError(
                f"{path}: this is no recording of run --record, and no log of pyserial's spy:// or of socat -x"
            )

    def __iter__(self) -> Iterator[Event]:
        """Yield all events of the file, in order. Raises UserError for an invalid line of a recording."""
        if self.recording is not None:
            return iter(self.recording)
        return _read_spy_log(self._path) if self._format == "spy" else _read_socat_log(self._path)

    def first_client_bytes(self) -> bytes:
        """Return the first bytes that clients sent."""
        sent = b""
        for event in self:
            if event.arrow == ">":
                sent += event.data
                if len(sent) >= CHUNK_BYTES:
                    break
        return sent[:CHUNK_BYTES]


def _lines(path: Path) -> Iterator[bytes]:
    with path.open("rb") as file:
        while line := file.readline(CHUNK_BYTES):
            yield line


def _capture_format(path: Path) -> str:
    """Return which tool wrote the capture, ``spy`` or ``socat``; empty if no line looks like either."""
    return next(
        (
            "spy" if _SPY_LINE.search(line) else "socat"
            for line in _lines(path)
            if _SPY_LINE.search(line) or _SOCAT_HEADER.match(line)
        ),
        "",
    )


def _read_spy_log(path: Path) -> Iterator[Event]:
    """Read a log of pyserial's ``spy://``: ``000000.002 TX   0000  3A 47 52 23  :GR#``."""
    for line in _lines(path):
        for at, way, octets in _SPY_LINE.findall(line):
            yield Event(float(at), "client", ">" if way == b"TX" else "<", bytes.fromhex(octets.decode()))


def _read_socat_log(path: Path) -> Iterator[Event]:
    """Read a log of ``socat -x``: a line with direction and time, then lines of bytes; the first side is the client."""
    event: Event | None = None
    data = bytearray()
    for line in chain(_lines(path), (b"> 0/0/0 0:0:0.0 length=0",)):
        head = _SOCAT_HEADER.match(line)
        if (head or len(data) > MAX_LINE_LENGTH) and event is not None:
            yield event._replace(data=bytes(data))
            data.clear()
        if head:
            hours, minutes, seconds = int(head.group(3)), int(head.group(4)), float(head.group(5))
            event = Event(hours * 3600 + minutes * 60 + seconds, "client", head.group(1).decode(), b"")
        elif event is not None and (octets := _SOCAT_BYTES.match(line)):
            data += bytes.fromhex(octets.group(1).decode())


def decode(events: Iterable[Event], decoder_of: Callable[[str], ConnectionDecoder], start_time: float) -> Iterator[str]:
    """Yield events as text lines. ``decoder_of`` makes a side's decoder. ``start_time``: Unix time of event time 0."""
    decoders: dict[str, ConnectionDecoder] = {}
    for event in events:
        if event.side not in decoders or event.arrow in "+~":
            decoders[event.side] = decoder_of(event.side)
        data, decoder = event.data, decoders[event.side]
        if event.arrow not in "<>":
            if event.arrow == "-":
                del decoders[event.side]
            yield _format_line(event, start_time, b"", describe_event(event.arrow, event.data.decode("latin-1")))
            continue
        pieces = decoder.decode_commands(data, event.time) if event.arrow == ">" else decoder.decode_replies(data)
        yield from [_format_line(event, start_time, message.data, message.text) for message in pieces]


def _format_line(event: Event, start_time: float, data: bytes, text: str) -> str:
    return as_one_line(Row(event.time + start_time, event.side, event.arrow, data, text))
