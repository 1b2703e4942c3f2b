"""Lines for systemd's journal have a level and no time; a file and a terminal get what they always got."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from gateway.cli import main
from gateway.core.wire_log import Entry
from gateway.diagnostics.log.printing import RowBuilder, line_printer
from gateway.system import streams

ASKED = Entry(1768514400.0, "mount", ">", b"V")
NOTED = Entry(1768514400.5, "mount", "!", b"", "the mount does not answer")


def led_to(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = os.stat(path)
    monkeypatch.setenv("JOURNAL_STREAM", f"{found.st_dev}:{found.st_ino}")


def test_log_lines_have_levels_in_the_journal_and_times_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "stream"
    with path.open("w") as stream:
        led_to(path, monkeypatch)
        for entry in (ASKED, NOTED):
            line_printer(RowBuilder("nexstar", []), stream)(entry)
        led_to(tmp_path, monkeypatch)  # the journal's, but another one's
        for entry in (ASKED, NOTED):
            line_printer(RowBuilder("nexstar", []), stream)(entry)
    in_journal, note, timed, timed_note = path.read_text().splitlines()
    assert in_journal.startswith("<6>mount")
    assert note.startswith("<5>mount") and note.endswith("the mount does not answer")
    assert timed == f"22:00:00.000 {in_journal[3:]}"
    assert timed_note == f"22:00:00.500 {note[3:]}"


def test_messages_name_mount_gateway_only_outside_the_systemd_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "stream"
    with path.open("w") as stream:
        assert streams.message_line("no such port", streams.WARNING, stream) == "mount-gateway: no such port"
        led_to(path, monkeypatch)
        assert streams.message_line("no such port", streams.WARNING, stream) == "<4>no such port"
        monkeypatch.setattr("sys.stderr", stream)
        assert main(["run"]) == 2
    assert not streams.is_read_by_journal(stream)  # a closed one
    assert path.read_text().startswith("<3>command line: which mount?")
