"""The log for programs: what becomes of a row, and of what the gateway says itself."""

from __future__ import annotations

import io
import json

from gateway.core.wire_log import Entry
from gateway.diagnostics.log import as_json
from gateway.diagnostics.log.layout import Row
from gateway.diagnostics.log.printing import RowBuilder

#: 2026-01-15 22:00:00.25 UTC.
AT = 1768514400.25


def told(*entries: Entry, log: str = "json") -> list[dict[str, object]]:
    """The objects of a log."""
    stream = io.StringIO()
    put = as_json.json_printer(RowBuilder("nexstar", ["lx200"], as_json.filter_name(log)), stream, "pier")
    for entry in entries:
        put(entry)
    return [json.loads(line) for line in stream.getvalue().splitlines()]


def test_json_log_holds_a_command_and_its_reply() -> None:
    command, reply = told(Entry(AT, "mount", ">", b"e"), Entry(AT + 0.5, "mount", "<", b"34AB0500,12CE0500#"))
    assert command | {"words": ""} == {
        "time": "2026-01-15T22:00:00.250Z", "mount": "pier", "side": "mount", "direction": "to mount",
        "kind": "command", "refused": False, "bytes": "e", "hex": "65", "words": "",
    }  # fmt: skip
    assert command["words"] and (reply["direction"], reply["kind"]) == ("from mount", "reply")
    assert reply["hex"] == b"34AB0500,12CE0500#".hex() and reply["time"] == "2026-01-15T22:00:00.750Z"


def test_json_log_preserves_unprintable_bytes_and_non_ascii_text() -> None:
    line = as_json.format_row(Row(AT, "10.0.0.2:5", ">", b"\x06\xdf#", "22°"), "pier")
    assert line.isascii() and "\n" not in line
    assert {"bytes": "\\x06\\xdf#", "hex": "06df23", "words": "22°"}.items() <= json.loads(line).items()


def test_json_log_marks_dropped_or_failed_commands_refused_and_events_without_direction() -> None:
    come, dropped, note, gone = told(
        Entry(AT, "10.0.0.2:5", "+", b"", "surface 1"),
        Entry(AT, "10.0.0.2:5", "x", b"K", "no command"),
        Entry(AT, "mount", "!", b"", "it is found"),
        Entry(AT, "10.0.0.2:5", "-", b""),
    )
    assert [one["kind"] for one in (come, dropped, note, gone)] == ["connected", "dropped", "note", "disconnected"]
    assert [one["refused"] for one in (come, dropped, note, gone)] == [False, True, False, False]
    assert {one["direction"] for one in (come, dropped, note, gone)} == {None}


def test_json_log_obeys_filters() -> None:
    entries = Entry(AT, "mount", ">", b"e"), Entry(AT, "mount", "<", b"34AB0500,12CE0500#")
    assert told(*entries, log="json-program") == [] and told(*entries, log="json-changes") == []
    assert len(told(*entries, log="json-mount")) == 2


def test_json_log_holds_messages_of_the_gateway() -> None:
    assert json.loads(as_json.format_warning(AT, "suspended")) == {
        "time": "2026-01-15T22:00:00.250Z", "mount": None, "side": "gateway", "direction": None,
        "kind": "warning", "refused": False, "bytes": "", "hex": "", "words": "suspended",
    }  # fmt: skip
