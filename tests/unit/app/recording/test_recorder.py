"""The file of a recording: private, bounded, and good up to its end, whatever becomes of the disk."""

from __future__ import annotations

import asyncio
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from gateway.app.recording import recorder as recorder_module
from gateway.app.recording.format import read
from gateway.app.recording.recorder import Recorder
from gateway.cli import main
from gateway.core.errors import UserError
from gateway.core.wire_log import Entry

SETTINGS: dict[str, Any] = {
    "began": 1768514400.0,
    "config": {"mount": {"at": "lx200@sim"}, "surface": [{"at": "lx200@tcp://:0"}]},
}


def _mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def _recorded(path: Path, times: int = 0, settings: dict[str, Any] = SETTINGS, **more: Any) -> None:
    """A recording of so many replies, from its beginning to its end."""

    async def work() -> None:
        recorder = Recorder(path, settings, **more)
        await _say(recorder, times)
        await recorder.close()

    asyncio.run(work())


async def _say(recorder: Recorder, times: int) -> None:
    """As many replies, each of which is written before the next."""
    for number in range(times):
        recorder.put(Entry(time.time(), "10.0.0.1:1", "<", b"reply %d#" % number))
        await recorder.flush()


def test_recording_and_its_parts_are_readable_by_the_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    before = os.umask(0)
    try:
        _recorded(path, 100, max_bytes=1000)
    finally:
        os.umask(before)
    files = sorted(tmp_path.iterdir())
    assert len(files) > 3
    assert {_mode(file) for file in files} == {0o600}


def test_recording_of_an_earlier_run_is_renamed_and_made_private(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    _recorded(path)
    path.chmod(0o644)
    watching = path.open("rb")  # somebody who could read it then does not see what comes
    seen = watching.read()
    _recorded(path, 10)
    assert watching.read() == b""
    watching.close()
    assert (tmp_path / "night.rec.1").read_bytes() == seen
    assert _mode(path) == _mode(tmp_path / "night.rec.1") == 0o600


def test_recorder_does_not_overwrite_a_file_that_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text("[mount]\n")
    with pytest.raises(UserError, match="not a recording"):
        _recorded(path)
    assert path.read_text() == "[mount]\n"


def test_recorder_keeps_a_limited_number_of_files_and_says_so_once(tmp_path: Path) -> None:
    path, said = tmp_path / "night.rec", list[str]()
    _recorded(path, 1000, max_bytes=1000, max_files=3, warn=said.append)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["night.rec", "night.rec.1", "night.rec.2"]
    assert all(file.stat().st_size < 1200 for file in tmp_path.iterdir())
    assert len(said) == 1
    assert "replaces the oldest" in said[0] and "record-keep" in said[0]
    assert read(path).settings["from"] > 0.0


def test_recorder_can_be_limited_to_one_file(tmp_path: Path) -> None:
    _recorded(tmp_path / "night.rec", 100, max_bytes=1000, max_files=1)
    assert [file.name for file in tmp_path.iterdir()] == ["night.rec"]


def test_recorder_deletes_excess_files_of_an_earlier_run(tmp_path: Path) -> None:
    for keep in (6, 2):
        _recorded(tmp_path / "night.rec", 200, max_bytes=1000, max_files=keep)
    assert len(list(tmp_path.iterdir())) == 2


def test_recorder_does_not_continue_parts_of_an_earlier_run(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    _recorded(path)
    _recorded(path, settings={**SETTINGS, "began": 1768600800.0})
    assert read(path).parts == [path]


def test_full_disk_is_reported_at_once_and_the_recording_so_far_stays_readable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    resource = pytest.importorskip("resource")
    path, said = tmp_path / "night.rec", list[str]()

    async def work() -> None:
        recorder = Recorder(path, SETTINGS, warn=said.append)
        for number in range(200):
            assert said or number < 160
            await _say(recorder, 1)
        await recorder.close()

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, hard))  # no file gets longer than this
    try:
        asyncio.run(work())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(said) == 1
    assert str(path) in said[0] and "ends here: File too large" in said[0] and "restart the gateway" in said[0]
    assert path.stat().st_size == 5000
    assert len(list(read(path))) > 90
    assert main(["decode", str(path)]) == 0
    assert "complete" in capsys.readouterr().out.splitlines()[-1]


def test_recording_to_a_device_is_refused_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no such device here")
    mode = _mode(full)
    with pytest.raises(UserError, match=r"/dev/full: .* a device"):
        _recorded(full)
    assert _mode(full) == mode


@pytest.mark.real_time
async def test_hanging_disk_delays_no_client_and_ends_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, said, hangs, write = tmp_path / "night.rec", list[str](), threading.Event(), os.write
    monkeypatch.setattr(recorder_module, "MAX_UNWRITTEN_LINES", 1000)
    monkeypatch.setattr(recorder_module, "DISK_CHECK_PERIOD", 0.05)
    recorder = Recorder(path, SETTINGS, warn=said.append)
    monkeypatch.setattr(os, "write", lambda file, data: hangs.wait(60.0) and write(file, data))
    try:
        async with asyncio.timeout(30.0):
            while not said:
                recorder.put(Entry(0.0, "10.0.0.1:1", "<", b"reply#"))
                await asyncio.sleep(0)
    finally:
        hangs.set()
    await recorder.close()
    assert len(said) == 1 and "the disk does not answer" in said[0]


_KILLED = """
import asyncio, pathlib, sys
from gateway.app.recording.recorder import Recorder
from gateway.core.wire_log import Entry

async def work():
    recorder = Recorder(pathlib.Path(sys.argv[1]), {"began": 0.0, "config": {}})
    number = 0
    while True:
        recorder.put(Entry(0.0, "mount", ">", b":GR#"))
        await asyncio.sleep(0.001)
        number += 1
        if number == 1000:
            print("half a second", flush=True)

asyncio.run(work())
"""


def test_recording_of_a_killed_process_is_readable(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    with subprocess.Popen([sys.executable, "-c", _KILLED, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        process.wait(30.0)
    recording = read(path)
    assert len(list(recording)) > 500
    assert "the recording ends" in recording.incomplete_reason or "cut off" in recording.incomplete_reason


@pytest.mark.real_time
async def test_line_breaks_in_names_and_notes_do_not_break_recording_lines(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    recorder = Recorder(path, SETTINGS)
    recorder.put(Entry(0.0, "a page\n9.9 mount\t> ", "*", b"", "Goto:\nit goes\r there\u2028°"))
    recorder.put(Entry(0.0, "mount", "raw", b"12\n \x00#"))
    recorder.put(Entry(0.0, "", "!", b"", ""))
    await recorder.close()
    events = [(event.side, event.arrow, event.data) for event in read(path)]
    assert events == [
        ("a_page_9.9_mount_>", "*", "Goto: it goes\r there?°".encode("latin-1")),
        ("mount", "<", b"12\n \x00#"),
        ("?", "!", b""),
        ("recording", "!", b"ends here"),
    ]


@pytest.mark.real_time
async def test_recording_ends_when_a_foreign_file_replaces_its_file(tmp_path: Path) -> None:
    path, said = tmp_path / "night.rec", list[str]()
    recorder = Recorder(path, SETTINGS, max_bytes=1000, warn=said.append)
    path.unlink()
    path.write_text("a letter")
    await _say(recorder, 100)
    await recorder.close()
    assert path.read_text() == "a letter"
    assert len(said) == 1 and "this file is not a recording" in said[0]


@pytest.mark.real_time
async def test_recorded_times_stay_right_when_the_computer_clock_is_set(tmp_path: Path) -> None:
    path, clock, now = tmp_path / "night.rec", [1e9], [50.0]
    recorder = Recorder(path, SETTINGS, clock=lambda: clock[0], now=lambda: now[0])
    for step, passed in ((0.0, 1.0), (3600.0, 1.0), (-7200.0, 2.0), (0.0, 0.5)):
        clock[0] += step
        now[0], clock[0] = now[0] + passed, clock[0] + passed
        recorder.put(Entry(clock[0], "mount", ">", b":GR#"))
        await recorder.flush()
    recorder.put(Entry(clock[0] + 900.0, "mount", ">", b":GR#"))  # from before the clock was set back
    await recorder.close()
    assert [event.time for event in read(path)] == [1.0, 2.0, 4.0, 4.5, 4.5, 4.5]
