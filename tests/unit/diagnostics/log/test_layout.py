"""Lines fit where they are read: 80 columns or a terminal's own; nothing is left out; colours where they are seen."""

from __future__ import annotations

import io
import re

import pytest

from gateway.core.wire_log import Entry, printable
from gateway.diagnostics.log import layout
from gateway.diagnostics.log.layout import Row, wrap_row
from gateway.diagnostics.log.printing import RowBuilder, line_printer
from tests.support.each import each

LONG = [
    Row(0.0, "mount", "<", b"331D2100,0DBC7900#", "e: RA 04:47:04, Dec +19°18'55\""),
    Row(0.0, "192.168.100.123:58288", ">", b"P\2\x10\x24\x09\0\0\0", "fixed rate, azimuth or right ascension"),
    Row(0.0, "[fe80::1234:5678:9abc:def0%eth0]:58288", "!", b"", "sends so much that it is read too late: " * 4),
    Row(0.0, "127.0.0.1:1", "x", bytes(range(256)), "dropped: no command of an LX200 begins so"),
    Row(0.0, "mount", ">", b":SM" + b"x" * 61 + b"#", "w" * 300),
    Row(0.0, "mount", "^", b"", "port opened", mount_name="observatory-pier"),
]


@each("columns", [1, 40, 60, 80, 100, 132, 250])
@each("row", LONG)
def test_log_line_is_wrapped_to_the_width_without_losing_text(row: Row, columns: int) -> None:
    lines = wrap_row(row, columns)
    assert max(len(line) for line in lines) <= max(columns, 40)
    assert all(line.startswith("    ") for line in lines[1:])
    told = "".join("".join(lines).split())
    for part in (row.side, printable(row.data), row.text, row.mount_name):
        assert "".join(part.split()) in told


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


ENTRIES = [
    Entry(0.0, "1.2.3.4:5", "+", b"", "surface 1, host 1.2.3.4"),
    Entry(0.0, "1.2.3.4:5", ">", b":GR#"),
    Entry(0.0, "1.2.3.4:5", "<", b"05:34:32#"),
    Entry(0.0, "mount", ">", b"e"),
    Entry(0.0, "mount", "<", b"34AB0500,12CE0500#"),
    Entry(0.0, "mount", "!", b"", "the mount does not answer"),
    Entry(0.0, "1.2.3.4:5", ">", b":Sr99#"),
    Entry(0.0, "1.2.3.4:5", "<", b"0"),
    Entry(0.0, "1.2.3.4:5", "x", b"Ka", "no command of an LX200 begins so"),
    Entry(0.0, "1.2.3.4:5", "-", b""),
]


def _printed(stream: io.StringIO, night: bool = False) -> str:
    put = line_printer(RowBuilder("nexstar", ["lx200"]), stream, night)
    for entry in ENTRIES:
        put(entry)
    return stream.getvalue()


@pytest.fixture(autouse=True)
def _plain_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(layout.sys, "platform", "linux")


def _colours(text: str) -> set[str]:
    return {part for code in re.findall(r"\x1b\[([\d;]*)m", text) for part in code.split(";")} - {"0"}


def test_log_is_coloured_on_a_terminal_but_not_in_a_file() -> None:
    assert len(_colours(_printed(Terminal()))) > 3
    assert "\x1b" not in _printed(io.StringIO())
    assert re.sub(r"\x1b\[[\d;]*m", "", _printed(Terminal())) == _printed(io.StringIO())


def test_log_is_red_in_night_mode() -> None:
    assert _colours(_printed(Terminal(), night=True)) <= {"31", "1", "2"}
    assert all(line.startswith("\x1b[") for line in _printed(Terminal(), night=True).splitlines())


@pytest.mark.parametrize(("name", "value"), [("NO_COLOR", "1"), ("TERM", "dumb")])
def test_log_without_colours_on_request_is_plain(name: str, value: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, value)
    assert "\x1b" not in _printed(Terminal()) and "\x1b" not in _printed(Terminal(), night=True)


def test_empty_no_color_variable_leaves_colours_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "")
    assert "\x1b" in _printed(Terminal())


def test_log_escapes_control_characters_of_a_program() -> None:
    stream = io.StringIO()
    put = line_printer(RowBuilder("nexstar", ["lx200"]), stream)
    for entry in (
        Entry(0.0, "1.2.3.4:5", ">", b":SM\x1b[2J#"),
        Entry(0.0, "1.2.3.4:5", "x", b"\x1b]0;t\x07", "why"),
        Entry(0.0, "1.2.3.4:5", "!", b"", "b':\x1b[2J' refused"),
        Entry(0.0, "mount", ">", b":GVP#"),
        Entry(0.0, "mount", "<", b"\x1b[2J#"),
    ):
        put(entry)
    assert all(char == "\n" or char.isprintable() for char in stream.getvalue())


def test_log_shows_a_surface_by_its_address() -> None:
    stream = io.StringIO()
    put = line_printer(RowBuilder("nexstar", ["lx200@tcp://:4030", "nexstar@tcp://:4031"]), stream)
    put(Entry(0.0, "1.2.3.4:5", "+", b"", "surface 2, host 1.2.3.4"))
    put(Entry(0.0, "1.2.3.4:5", ">", b"e"))
    assert "connected, nexstar@tcp://:4031, host 1.2.3.4" in " ".join(stream.getvalue().split())
    assert "surface" not in stream.getvalue()
    assert "right ascension" in stream.getvalue()
