"""The sink that prints the log: entries of the wire log become rows, and the filtered rows become lines of a stream."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TextIO

from gateway.clients.wrong_preset import other
from gateway.core.wire_log import MOUNT, Entry, show
from gateway.diagnostics.log.conversation import Heard, Side
from gateway.diagnostics.log.folding import Folding, Told
from gateway.diagnostics.log.layout import Row, colours_of, columns_of, painted, plain, wrapped
from gateway.protocols.registry import ANY, guess
from gateway.system import streams

#: Entries that are not shown: raw bytes (shown as commands), the controller's decisions, and a lost port (a note
#: follows).
SILENT = ("raw", "r", "v")
#: The meaning of the arrows that carry no bytes.
EVENTS = {"+": "connected", "-": "gone", "~": "speaks", "^": "port opened", "v": "port lost"}


class Rows:
    """Turns entries into rows. ``surfaces`` are the endpoints of the surfaces in their order, or only the protocols."""

    def __init__(self, mount: str, surfaces: Sequence[str], shown: str = "all", name: str = "") -> None:
        self._mount, self._surfaces, self._name = mount, surfaces, name
        self._shown = shown
        self._folding = Folding(shown)
        self._sides: dict[str, Side] = {}
        self._asked: dict[str, bytes] = {}

    def take(self, entry: Entry) -> Iterable[Row]:
        """Process one entry and return the rows to show now."""
        ours = entry.side == MOUNT
        if entry.arrow in SILENT or self._shown == (MOUNT if not ours else "program"):
            return ()
        host = entry.side.rpartition(":")[0] or entry.side
        kind = "mount" if ours else "program"
        if entry.arrow == "+":
            self._begin(entry)
        heard = self._heard(entry)
        if entry.arrow not in "<>":
            kind = {"!": "note", "x": "no"}.get(entry.arrow, "event")
        row = Row(
            entry.time, entry.side, entry.arrow, entry.data, heard.words, "no" if heard.fails else kind, self._name
        )
        asked = self._asked.get(entry.side, b"") if entry.arrow == "<" else b""
        if entry.arrow == ">":
            self._asked[entry.side] = bytes(entry.data)
        elif entry.arrow == "~":
            self._sides[entry.side] = Side(entry.note.partition(",")[0])
        elif entry.arrow == "-":
            self._sides.pop(entry.side, None)
            self._asked.pop(entry.side, None)
        return self._folding.take(Told(row, host, heard, asked))

    def _surface(self, entry: Entry) -> str:
        """Return the surface to which a client has connected; the entry contains its number. Empty if it is unknown."""
        number = entry.note.partition(",")[0].rpartition(" ")[2]
        return self._surfaces[int(number) - 1] if number.isdecimal() and 0 < int(number) <= len(self._surfaces) else ""

    def _begin(self, entry: Entry) -> None:
        if surface := self._surface(entry):
            protocol = surface.partition("@")[0].partition(":")[0]
            if protocol != ANY:  # an entry for the recognised protocol follows
                self._sides[entry.side] = Side(protocol)

    def _heard(self, entry: Entry) -> Heard:
        """Describe an entry in words."""
        if entry.arrow not in "<>x":
            note = entry.note
            if entry.arrow == "+" and "@" in (surface := self._surface(entry)):
                note = note.replace(note.partition(",")[0], surface, 1)
            return Heard(entry.data, happened(entry.arrow, _plain(note)))
        side = self._sides.get(entry.side)
        if side is None and entry.arrow == "<" and entry.side != MOUNT:
            # A client that connected before this log began: its next command shows its protocol.
            return Heard(entry.data, _plain(entry.note), fails=bool(entry.note))
        if side is None:
            protocol = self._mount if entry.side == MOUNT else guess(entry.data) or self._mount
            side = self._sides[entry.side] = Side(protocol)
        if entry.arrow == "x":
            foreign = other(side.protocol, entry.data)
            words = f"; {foreign} has such a command" if foreign else ""
            return Heard(entry.data, f"dropped: {entry.note}{words}", fails=True)
        if entry.note:
            return Heard(entry.data, _plain(entry.note), fails=True)
        return side.command(entry.data) if entry.arrow == ">" else side.reply(entry.data)


def happened(arrow: str, note: str) -> str:
    """Describe an event that carries no bytes."""
    return (" " if arrow == "~" else ", ").join(filter(None, (EVENTS.get(arrow, ""), note)))


def _plain(text: str) -> str:
    """Escape control characters, as the text may contain what a client has sent: it must not control the terminal."""
    return "".join(char if char.isprintable() else show(char.encode("utf-8", "replace")) for char in text)


def printer(rows: Rows, stream: TextIO, night: bool = False) -> Callable[[Entry], None]:
    """Return a sink that writes lines to a stream; in systemd's journal notes have a higher level than the rest."""
    notice, info = (streams.level(number, stream) for number in (streams.NOTICE, streams.INFO))
    colours, columns = colours_of(stream, night), columns_of(stream)

    def put(entry: Entry) -> None:
        for row in rows.take(entry):
            level = notice if row.arrow == "!" else info
            for line in [plain(row, timed=False)] if level else wrapped(row, columns()):
                stream.write(f"{level}{painted(line, row.kind, colours)}\n")
        stream.flush()

    return put
