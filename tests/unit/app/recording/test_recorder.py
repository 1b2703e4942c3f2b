"""The file of a recording: private, bounded, and good up to its end, whatever becomes of the disk."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Any

import pytest

from gateway.app.recording.format import read
from gateway.app.recording.recorder import Recorder
from gateway.cli import main
from gateway.core.errors import UserError
from gateway.core.wire_log import Entry

SETTINGS: dict[str, Any] = {
    "began": 1768514400.0,
    "config": {"mount": {"at": "lx200@sim"}, "surface": [{"at": "lx200@tcp://:0"}]},
    "past": {},
}


def _mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def _recorder(path: Path, **more: Any) -> Recorder:
    return Recorder(path, iter(range(1_000_000)).__next__, SETTINGS, **more)


def _say(recorder: Recorder, times: int) -> None:
    for number in range(times):
        recorder.put(Entry(0.0, "10.0.0.1:1", "<", b"reply %d#" % number))


def test_only_the_owner_reads_it_and_its_parts_whatever_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    before = os.umask(0)
    try:
        recorder = _recorder(path, longest=1000)
        _say(recorder, 100)
        recorder.close()
    finally:
        os.umask(before)
    files = sorted(tmp_path.iterdir())
    assert len(files) > 3
    assert {_mode(file) for file in files} == {0o600}


def test_an_earlier_run_s_recording_is_put_aside_and_made_private(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    _recorder(path).close()
    path.chmod(0o644)
    watching = path.open("rb")  # somebody who could read it then does not see what comes
    seen = watching.read()
    recorder = _recorder(path)
    _say(recorder, 10)
    recorder.close()
    assert watching.read() == b""
    watching.close()
    assert (tmp_path / "night.rec.1").read_bytes() == seen
    assert _mode(path) == _mode(tmp_path / "night.rec.1") == 0o600


def test_a_file_of_another_kind_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text("[mount]\n")
    with pytest.raises(UserError, match="left alone"):
        _recorder(path)
    assert path.read_text() == "[mount]\n"


def test_so_many_files_are_kept_and_it_is_said_once(tmp_path: Path) -> None:
    path, said = tmp_path / "night.rec", []
    recorder = _recorder(path, longest=1000, keep=3, warn=said.append)
    _say(recorder, 1000)
    recorder.close()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["night.rec", "night.rec.1", "night.rec.2"]
    assert all(file.stat().st_size < 1200 for file in tmp_path.iterdir())
    assert len(said) == 1
    assert "the oldest is deleted" in said[0] and "record-keep" in said[0]
    assert read(path).settings["from"] > 0.0


def test_one_file_may_be_all_that_is_kept(tmp_path: Path) -> None:
    recorder = _recorder(tmp_path / "night.rec", longest=1000, keep=1)
    _say(recorder, 100)
    recorder.close()
    assert [file.name for file in tmp_path.iterdir()] == ["night.rec"]


def test_fewer_files_than_there_are_from_another_run(tmp_path: Path) -> None:
    for keep in (6, 2):
        recorder = _recorder(tmp_path / "night.rec", longest=1000, keep=keep)
        _say(recorder, 200)
        recorder.close()
    assert len(list(tmp_path.iterdir())) == 2


def test_parts_of_another_run_are_not_taken_for_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "night.rec"
    _recorder(path).close()
    Recorder(path, iter(range(10)).__next__, {**SETTINGS, "began": 1768600800.0}).close()
    assert read(path).parts == [path]
    assert read(tmp_path / "night.rec.1").continues_in is None


def test_a_full_disk_is_told_at_once_and_what_was_written_stays_good(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    resource = pytest.importorskip("resource")
    path, said = tmp_path / "night.rec", []
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, hard))  # no file gets longer than this
    try:
        recorder = _recorder(path, warn=said.append)
        for number in range(200):
            assert said or number < 140
            _say(recorder, 1)
        recorder.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(said) == 1
    assert str(path) in said[0] and "ends here: File too large" in said[0] and "restart the gateway" in said[0]
    text = path.read_text()
    assert 4000 < len(text) < 5000
    assert text.endswith("\n")
    recording = read(path)
    assert len(list(recording)) > 90
    assert "File too large" in recording.cut
    assert main(["decode", str(path)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert "could not be written any more" in told[-1]


def test_a_device_in_place_of_a_file_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no such device here")
    mode = _mode(full)
    with pytest.raises(UserError, match="cannot record to /dev/full: this is a pipe or a device"):
        _recorder(full)
    assert _mode(full) == mode
