"""The log for programs that collect logs: one JSON object a line, always with the same keys.

Nothing is wrapped, coloured or shortened. A line is ASCII, whatever a program or a mount has sent, so that any stream
can take it. In systemd's journal its level stands before it, which the journal takes off again.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import TYPE_CHECKING, TextIO

from gateway.core.wire_log import Entry, show
from gateway.system import streams

if TYPE_CHECKING:
    from gateway.diagnostics.log.layout import Row
    from gateway.diagnostics.log.printing import Rows

#: What the value of ``log`` begins with when this form is wanted; behind a hyphen stands what is left out.
FORM = "json"
#: What the arrows of rows are called.
KINDS = {
    ">": "command",
    "<": "reply",
    "=": "repeated",
    "!": "note",
    "x": "dropped",
    "+": "connected",
    "-": "disconnected",
    "~": "protocol",
    "^": "port opened",
}
#: Which way bytes go; what only happens goes no way.
DIRECTIONS = {">": "to mount", "<": "from mount"}


def wanted(log: bool | str) -> bool:
    """Whether a value of ``log`` asks for this form."""
    return isinstance(log, str) and log.partition("-")[0] == FORM


def kept(log: bool | str) -> str:
    """What a value of ``log`` asks to be shown, whatever the form: "all" where it says no more."""
    return (log.removeprefix(FORM).removeprefix("-") if isinstance(log, str) else "") or "all"


def written(row: Row, mount: str) -> str:
    """A row as one line. ``mount`` is its name, or the endpoint where it has none."""
    return _line(
        row.time, mount, row.side, KINDS.get(row.arrow, row.arrow), row.words,
        direction=DIRECTIONS.get(row.arrow), refused=row.kind == "no", data=row.data,
    )  # fmt: skip


def warning(time: float, words: str) -> str:
    """What the gateway itself says, as such a line."""
    return _line(time, None, "gateway", "warning", words)


def _line(
    time: float, mount: str | None, side: str, kind: str, words: str,
    direction: str | None = None, refused: bool = False, data: bytes = b"",
) -> str:  # fmt: skip
    import json  # whoever asks for no such log does not wait for it at the start

    told = {
        "time": datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z",
        "mount": mount,
        "side": side,
        "direction": direction,
        "kind": kind,
        "refused": refused,
        "bytes": show(data),
        "hex": data.hex(),
        "words": words,
    }
    return json.dumps(told)


def json_printer(rows: Rows, stream: TextIO, mount: str) -> Callable[[Entry], None]:
    """A sink that writes such lines to a stream."""
    notice, info = (streams.level(number, stream) for number in (streams.NOTICE, streams.INFO))

    def put(entry: Entry) -> None:
        for row in rows.take(entry):
            stream.write(f"{notice if row.arrow == '!' else info}{written(row, mount)}\n")
        stream.flush()

    return put
