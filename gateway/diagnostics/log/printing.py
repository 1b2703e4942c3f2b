"""The sink that prints the log: wire log entries become rows, and the rows that pass a filter become lines.

A query that repeats is shown once, then counted. Only queries are ever left out, and only while their replies bring
nothing new: positions and clocks may change, any other change is shown. Commands that move or set something, failures
and notes are always shown, and so is the next query after each. A program that reconnects counts as one connection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TextIO

from msgspec import Struct

from gateway.clients.wrong_preset import other_telescope_type
from gateway.core.wire_log import MOUNT_SIDE, Entry, printable
from gateway.diagnostics.log.conversation import ConnectionDecoder, DecodedMessage
from gateway.diagnostics.log.layout import Row, as_one_line, colours_of, columns_getter, paint_line, wrap_row
from gateway.protocols.registry import ANY, guess_protocol
from gateway.protocols.wireformat.command_set import load
from gateway.system import streams

#: Seconds after which the log shows how often a query has been repeated.
REPEAT_REPORT_PERIOD = 10.0
#: If a host reconnects within so many seconds, the counts of repeated queries continue.
RECONNECT_WINDOW = 60.0
#: The most lines of a connection that wait, not shown yet, until the filter can decide whether to show them.
MAX_HELD_LINES = 32
#: The key under which messages without a request are counted.
UNPROMPTED_KEY = b""
#: How many disconnected hosts are remembered.
MAX_HOSTS = 64


class LogLine(Struct, frozen=True):
    """A line that may be shown: row, host, decoded message, and for a reply the query that it answers."""

    row: Row
    host: str
    message: DecodedMessage
    query: bytes  # the bytes of that query; empty if the line is no reply


#: The arrows of a new connection and of its recognised protocol.
CONNECTION_ARROWS = "+~"


class _RepeatedQuery:
    """A repeated query: when it was last shown, how often it was answered since then, and its latest reply."""

    def __init__(self, shown_at: float) -> None:
        self.shown_at, self.count = shown_at, 0
        self.last_values: tuple[object, ...] | None = None
        self.last_reply = ""


class _LoggedConnection:
    """The filter's state for a connection. If its host reconnects soon, the new connection uses the same state."""

    def __init__(self) -> None:
        self.polls: dict[bytes, _RepeatedQuery] = {}
        self.held_rows: list[Row] = []
        self.closed_at = -1e9


class LogFilter:
    """Decides which lines are shown, in their order.

    The user selects "all"; "normal", which shows no list of repeated queries before another line; "changes", which
    omits answered queries; or "refusals", which omits everything that succeeds.
    """

    def __init__(self, filter_name: str = "all") -> None:
        self._filter_name = filter_name
        self._open_connections: dict[str, _LoggedConnection] = {}
        self._closed_connections: dict[str, _LoggedConnection] = {}

    def process(self, line: LogLine) -> list[Row]:
        """Process the next line and return the rows to show now."""
        match line.row.arrow:
            case "+":
                return self._connection_opened(line)
            case "~":
                return self._protocol_recognised(line)
            case "-":
                return self._connection_closed(line)
            case ">":
                return self._on_request(line)
            case "<":
                return self._on_reply(line)
        return self._show_line(self._connection_of(line), line)

    def _connection_of(self, line: LogLine) -> _LoggedConnection:
        return self._open_connections.setdefault(line.row.side, _LoggedConnection())

    # --- connections --------------------------------------------------------------------------------------------------

    def _connection_opened(self, line: LogLine) -> list[Row]:
        connection = self._closed_connections.pop(line.host, None)
        is_host_connected = any(side.rpartition(":")[0] == line.host for side in self._open_connections)
        if connection is None or is_host_connected or line.row.time - connection.closed_at > RECONNECT_WINDOW:
            connection = _LoggedConnection()
        self._open_connections[line.row.side] = connection
        if not connection.polls and self._filter_name != "refusals":
            return [line.row]
        connection.held_rows = [line.row]
        return []

    def _protocol_recognised(self, line: LogLine) -> list[Row]:
        """Handle the recognition of a connection's protocol, which is shown together with the connection."""
        connection = self._connection_of(line)
        if not connection.held_rows and self._filter_name != "refusals":
            return self._show_line(connection, line)
        connection.held_rows.append(line.row)
        return []

    def _connection_closed(self, line: LogLine) -> list[Row]:
        ended = self._open_connections.pop(line.row.side, None) or _LoggedConnection()
        ended.closed_at = line.row.time
        self._closed_connections[line.host] = ended
        if len(self._closed_connections) > MAX_HOSTS:
            del self._closed_connections[next(iter(self._closed_connections))]
        silent = bool(ended.held_rows) and ended.held_rows[0].arrow == "+"
        rows = self._show_unanswered(ended)
        if silent and not rows:
            ended.held_rows.clear()
            return []
        return [*rows, *self._repeat_counts_row(ended, line.row), line.row] if self._filter_name != "refusals" else rows

    # --- commands and replies -----------------------------------------------------------------------------------------

    def _on_request(self, line: LogLine) -> list[Row]:
        connection = self._connection_of(line)
        rows = self._show_unanswered(connection)
        if line.message.fails:
            return [*rows, *self._show_line(connection, line)]
        if not line.message.is_query:
            if self._filter_name == "refusals":
                connection.held_rows.append(line.row)
                return rows
            return [*rows, *self._show_line(connection, line)]
        if line.row.data in connection.polls or self._filter_name in ("changes", "refusals"):
            connection.held_rows.append(line.row)
            return rows
        connection.polls[line.row.data] = _RepeatedQuery(line.row.time)
        return [*rows, *self._take_held_rows(connection), line.row]

    def _on_reply(self, line: LogLine) -> list[Row]:
        connection = self._connection_of(line)
        if line.message.fails:
            return self._show_line(connection, line)
        if self._filter_name == "refusals" or (line.message.is_query and self._filter_name == "changes"):
            connection.held_rows = [row for row in connection.held_rows if row.arrow in CONNECTION_ARROWS]
            return []
        asked: Row | None = line.row
        if line.message.pushed:
            key, run = UNPROMPTED_KEY, connection.polls.setdefault(UNPROMPTED_KEY, _RepeatedQuery(line.row.time))
        else:
            key, repeated = line.query, connection.polls.get(line.query) if line.message.is_query else None
            if repeated is None:
                return self._show_line(connection, line)
            run, asked = repeated, next((row for row in connection.held_rows if row.arrow == ">"), None)
        new, run.last_values = run.last_values != line.message.steady_values, line.message.steady_values
        if asked is None or new:
            counted = self._count_row(key, run, asked) if asked is not None else []
            run.shown_at = line.row.time
            return [*counted, *self._take_held_rows(connection), line.row]
        if not line.message.pushed:
            connection.held_rows.remove(asked)
        run.count, run.last_reply = run.count + 1, line.row.text
        return self._count_row(key, run, line.row) if line.row.time - run.shown_at >= REPEAT_REPORT_PERIOD else []

    def _show_unanswered(self, connection: _LoggedConnection) -> list[Row]:
        """Return the held rows if a request is among them, which was not answered before the next one; else []."""
        if all(row.arrow in CONNECTION_ARROWS for row in connection.held_rows):
            return []
        if self._filter_name == "refusals":
            connection.held_rows = [row for row in connection.held_rows if row.arrow in CONNECTION_ARROWS]
            return []
        return self._take_held_rows(connection)

    def _show_line(self, connection: _LoggedConnection, line: LogLine) -> list[Row]:
        """Return a line to show, after the counts of repeated queries and the held lines; restart the counts."""
        rows = [*self._repeat_counts_row(connection, line.row), *self._take_held_rows(connection), line.row]
        connection.polls.clear()
        return rows

    def _take_held_rows(self, connection: _LoggedConnection) -> list[Row]:
        rows, connection.held_rows = connection.held_rows[-MAX_HELD_LINES:], []
        return rows

    def _repeat_counts_row(self, connection: _LoggedConnection, row: Row) -> list[Row]:
        """Return a row with the counts of all repeated queries that were not shown yet; an empty list without any."""
        counts = {printable(asked) or "line unasked": run.count for asked, run in connection.polls.items() if run.count}
        for run in connection.polls.values():
            run.count, run.shown_at = 0, row.time
        if not counts or self._filter_name == "normal":
            return []
        text = "repeated: " + ", ".join(f"{asked} ×{count}" for asked, count in counts.items())
        return [Row(row.time, row.side, "=", b"", text, "again", row.mount_name)]

    def _count_row(self, query: bytes, repeated: _RepeatedQuery, row: Row) -> list[Row]:
        """Return a row that says how often a query was repeated since it was last shown, with its latest reply."""
        if not repeated.count:
            return []
        text = f"{_times_text(repeated.count)} more in {row.time - repeated.shown_at:.0f} s, now {repeated.last_reply}"
        repeated.count, repeated.shown_at = 0, row.time
        return [Row(row.time, row.side, "=", query, text, "again", row.mount_name)]


def _times_text(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


#: Entries that are not shown: raw bytes (shown as commands), and a lost port (a note follows).
HIDDEN_ARROWS = ("raw", "v")
#: The meaning of the arrows that carry no bytes.
EVENT_WORDS = {"+": "connected", "-": "gone", "~": "speaks", "^": "port opened", "v": "port lost"}


class RowBuilder:
    """Turns wire log entries into rows. ``surfaces``: endpoints, or protocols, of the surfaces in their order."""

    def __init__(
        self, mount_protocol: str, surfaces: Sequence[str], filter_name: str = "all", mount_name: str = ""
    ) -> None:
        self._mount_protocol, self._surfaces, self._mount_name = mount_protocol, surfaces, mount_name
        self._filter_name = filter_name
        self._log_filter = LogFilter(filter_name)
        self._connection_decoders: dict[str, ConnectionDecoder] = {}
        self._last_queries: dict[str, bytes] = {}

    def process(self, entry: Entry) -> Iterable[Row]:
        """Process an entry and return the rows to show now."""
        is_mount = entry.side == MOUNT_SIDE
        if entry.arrow in HIDDEN_ARROWS or self._filter_name == (MOUNT_SIDE if not is_mount else "program"):
            return ()
        host = entry.side.rpartition(":")[0] or entry.side
        kind = "mount" if is_mount else "program"
        if entry.arrow == "+":
            self._set_surface_protocol(entry)
        heard = self._describe_entry(entry)
        if entry.arrow not in "<>":
            kind = {"!": "note", "x": "no"}.get(entry.arrow, "event")
        row = Row(
            entry.time, entry.side, entry.arrow, entry.data, heard.text, "no" if heard.fails else kind, self._mount_name
        )
        asked = self._last_queries.get(entry.side, b"") if entry.arrow == "<" else b""
        if entry.arrow == ">":
            self._last_queries[entry.side] = bytes(entry.data)
        elif entry.arrow == "~":
            self._connection_decoders[entry.side] = ConnectionDecoder(entry.note.partition(",")[0])
        elif entry.arrow == "-":
            self._connection_decoders.pop(entry.side, None)
            self._last_queries.pop(entry.side, None)
        return self._log_filter.process(LogLine(row, host, heard, asked))

    def set_protocol(self, side: str, protocol: str) -> None:
        """Note the protocol of a connection that was open before this log began."""
        self._connection_decoders[side] = ConnectionDecoder(protocol)

    def _surface(self, entry: Entry) -> str:
        """Return the surface whose number a connection's entry contains; empty if it is unknown."""
        number = entry.note.partition(",")[0].rpartition(" ")[2]
        return self._surfaces[int(number) - 1] if number.isdecimal() and 0 < int(number) <= len(self._surfaces) else ""

    def _set_surface_protocol(self, entry: Entry) -> None:
        if surface := self._surface(entry):
            protocol = surface.partition("@")[0].partition(":")[0]
            if protocol != ANY:  # an entry for the recognised protocol follows
                self._connection_decoders[entry.side] = ConnectionDecoder(protocol)

    def _describe_entry(self, entry: Entry) -> DecodedMessage:
        """Decode and describe an entry."""
        if entry.arrow not in "<>x":
            note = entry.note
            if entry.arrow == "+" and "@" in (surface := self._surface(entry)):
                note = note.replace(note.partition(",")[0], surface, 1)
            return DecodedMessage(entry.data, describe_event(entry.arrow, _escape(note)))
        decoder = self._connection_decoders.get(entry.side)
        if decoder is None and entry.arrow == "<" and entry.side != MOUNT_SIDE:
            # A client that connected before this log began: its next command shows its protocol.
            return DecodedMessage(entry.data, _escape(entry.note), fails=bool(entry.note))
        if decoder is None:
            protocol = self._mount_protocol if entry.side == MOUNT_SIDE else guess_protocol(entry.data)
            # What is no command of any protocol says nothing of what follows.
            if protocol is None or (entry.side != MOUNT_SIDE and load(protocol).find(entry.data) is None):
                return DecodedMessage(entry.data, _escape(entry.note), fails=bool(entry.note))
            decoder = self._connection_decoders[entry.side] = ConnectionDecoder(protocol)
        if entry.arrow == "x":
            foreign = other_telescope_type(decoder.protocol, entry.data)
            hint = f"; {foreign} has such a command" if foreign else ""
            return DecodedMessage(entry.data, f"dropped: {entry.note}{hint}", fails=True)
        if entry.note:
            return DecodedMessage(entry.data, _escape(entry.note), fails=True)
        describe = decoder.describe_command if entry.arrow == ">" else decoder.describe_reply_to_last
        return describe(entry.data)


def describe_event(arrow: str, note: str) -> str:
    """Describe an event that carries no bytes."""
    return (" " if arrow == "~" else ", ").join(filter(None, (EVENT_WORDS.get(arrow, ""), note)))


def _escape(text: str) -> str:
    """Escape control characters, as the text may contain what a client has sent: it must not control the terminal."""
    return "".join(char if char.isprintable() else printable(char.encode("utf-8", "replace")) for char in text)


def line_printer(row_builder: RowBuilder, stream: TextIO, night_colours: bool = False) -> Callable[[Entry], None]:
    """Return a sink that writes lines to a stream; in systemd's journal notes have a higher level than the rest."""
    notice, info = (streams.journal_prefix(number, stream) for number in (streams.NOTICE, streams.INFO))
    colours, columns = colours_of(stream, night_colours), columns_getter(stream)

    def write(entry: Entry) -> None:
        for row in row_builder.process(entry):
            level = notice if row.arrow == "!" else info
            for line in [as_one_line(row, with_time=False)] if level else wrap_row(row, columns()):
                stream.write(f"{level}{paint_line(line, row.kind, colours)}\n")
        stream.flush()

    return write
