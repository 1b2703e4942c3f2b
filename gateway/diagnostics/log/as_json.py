"""The log as one JSON object per line, always with the same keys, for programs that collect logs.

Nothing is wrapped, coloured or shortened. Lines are ASCII, whatever a client or a mount has sent, so that any stream
accepts them. Under systemd each line starts with its level, which the journal removes.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TextIO

from gateway.core.wire_log import Entry, printable
from gateway.system import streams

if TYPE_CHECKING:
    from gateway.diagnostics.log.layout import Row
    from gateway.diagnostics.log.printing import RowBuilder

#: The value of ``log`` that selects this format; a hyphen and a filter may follow, as in ``json-changes``.
JSON_FORMAT = "json"
#: The name of each event kind, by the arrow of its log row.
EVENT_KINDS = {
    ">": "command",
    "<": "reply",
    "=": "repeated",
    "!": "note",
    "*": "request",
    "x": "dropped",
    "+": "connected",
    "-": "disconnected",
    "~": "protocol",
    "^": "port opened",
}
#: The direction of bytes; other events have none.
DIRECTIONS = {">": "to mount", "<": "from mount"}


def selects_json(log_setting: bool | str) -> bool:
    """Whether this value of the setting ``log`` selects the JSON format."""
    return isinstance(log_setting, str) and log_setting.partition("-")[0] == JSON_FORMAT


def filter_name(log: bool | str) -> str:
    """Return the filter that a value of the setting ``log`` names: "normal" for true, "all" if it names none."""
    if log is True:
        return "normal"
    return (log.removeprefix(JSON_FORMAT).removeprefix("-") if isinstance(log, str) else "") or "all"


def format_row(row: Row, mount_name: str) -> str:
    """Format a row as one line. ``mount_name`` is the mount's name, or its endpoint if it has no name."""
    return _format_line(
        row.time, mount_name, row.side, EVENT_KINDS.get(row.arrow, row.arrow), row.text,
        direction=DIRECTIONS.get(row.arrow), refused=row.kind == "no", data=row.data,
    )  # fmt: skip


def format_warning(time: float, text: str) -> str:
    """Format a warning of the gateway itself as one line."""
    return _format_line(time, None, "gateway", "warning", text)


def _format_line(
    time: float, mount: str | None, side: str, kind: str, text: str,
    direction: str | None = None, refused: bool = False, data: bytes = b"",
) -> str:  # fmt: skip
    import json  # imported here to keep it out of a start without a JSON log

    fields = {
        "time": datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z",
        "mount": mount,
        "side": side,
        "direction": direction,
        "kind": kind,
        "refused": refused,
        "bytes": printable(data),
        "hex": data.hex(),
        "words": text,
    }
    return json.dumps(fields)


def json_printer(row_builder: RowBuilder, stream: TextIO, mount_name: str) -> Callable[[Entry], None]:
    """Return a sink for wire log entries, which writes them as JSON lines to a stream."""
    notice, info = (streams.journal_prefix(number, stream) for number in (streams.NOTICE, streams.INFO))

    def write(entry: Entry) -> None:
        for row in row_builder.process(entry):
            stream.write(f"{notice if row.arrow == '!' else info}{format_row(row, mount_name)}\n")
        stream.flush()

    return write
