"""The conversation as lines a person reads: time, who, direction, bytes, meaning."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import TextIO

from gateway import journal
from gateway.tables import load
from gateway.transcript import Entry

#: What a person need not see: bytes shown as commands, the hub's own decisions, a lost port that has a note besides.
SILENT = ("raw", "r", "v")
#: What arrows mean that are no bytes.
EVENTS = {"+": "connected", "-": "gone", "^": "port opened", "v": "port lost"}


def show(data: bytes) -> str:
    """Bytes with everything unprintable as ``\\xHH``."""
    return "".join(chr(byte) if 32 <= byte < 127 and byte != 92 else f"\\x{byte:02x}" for byte in data)


def meaning(protocol: str, data: bytes) -> str:
    """What a request means, by the manual's words; empty for what no manual knows."""
    found = load(protocol).find(data)
    return found[0].help if found else ""


def line(entry: Entry, mount_protocol: str, name: str | None = None) -> str:
    """One entry as one line, without the line's end; ``name`` is the mount's, where there are several."""
    return f"{stamp(entry.time)} {untimed(entry, mount_protocol, name)}"


def untimed(entry: Entry, mount_protocol: str, name: str | None = None) -> str:
    """The same without the time, for whoever has a clock of his own."""
    words = entry.note or EVENTS.get(entry.arrow, "")
    if not words and entry.arrow == ">":
        client = "lx200" if entry.data[:1] in (b":", b"\x06", b"$") else "nexstar"
        words = meaning(mount_protocol if entry.side == "mount" else client, entry.data)
    called = f"{name:<8} " if name else ""
    return called + row(entry.side, entry.arrow, entry.data, words)


def row(side: str, arrow: str, data: bytes, words: str) -> str:
    """Who, direction, bytes and meaning in columns."""
    return f"{side:<21} {arrow} {show(data):<24} {words}".rstrip()


def stamp(unix: float) -> str:
    """The time of the day, UTC, to the millisecond."""
    return datetime.fromtimestamp(unix, UTC).strftime("%H:%M:%S.%f")[:-3]


def printer(mount_protocol: str, stream: TextIO, name: str | None = None) -> Callable[[Entry], None]:
    """A sink that writes one line per entry; in systemd's journal a note has a higher level than what was said."""
    notice, info = (journal.level(number, stream) for number in (journal.NOTICE, journal.INFO))

    def put(entry: Entry) -> None:
        if entry.arrow not in SILENT:
            level = notice if entry.arrow == "!" else info
            show_entry = untimed if level else line
            stream.write(f"{level}{show_entry(entry, mount_protocol, name)}\n")
            stream.flush()

    return put
