"""A pipe, a device or a folder where a file is expected is refused in a sentence; nothing waits for its other end."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.app.config.reading import read_tables
from gateway.app.recording.format import is_recording
from gateway.app.recording.recorder import Recorder
from gateway.app.state.file import MarkerContent, read_marker, read_state
from gateway.cli.inspect.detect import write_atomically
from gateway.cli.serve import sim
from gateway.core.errors import UserError
from gateway.system.files import replace_file
from tests.support.each import each

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="only where there are pipes among files")


def record(path: Path) -> object:
    return Recorder(path, {"began": 0.0})


def truth(path: Path) -> object:
    return sim._open_truth_file(str(path))


def write(path: Path) -> object:
    return write_atomically(path, "", force=True)


def replace(path: Path) -> object:
    return replace_file(path.with_name("pipe"), b"")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("pipe", ".pipe.new"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "folder").mkdir()
    return tmp_path


@each(("does", "name"), [
    (does, name) for does in (read_tables, is_recording, record, read_state, truth, write)
    for name in ("pipe", "zero", "folder")
])  # fmt: skip
def test_pipe_device_or_folder_instead_of_a_file_is_refused_in_a_sentence(
    folder: Path, does: Callable[[Path], object], name: str
) -> None:
    with pytest.raises(
        (UserError, OSError), match="folder|directory" if name == "folder" else "a plain file is needed"
    ):
        does(folder / name)


def test_named_pipe_as_state_file_is_refused_at_once(folder: Path) -> None:
    with pytest.raises(OSError, match="a plain file is needed"):
        replace(folder / "pipe")


def test_unreadable_motion_marker_file_counts_as_a_mount_in_motion(folder: Path) -> None:
    assert [read_marker(folder / name) for name in ("pipe", "zero", "folder")] == [MarkerContent("", 9600)] * 3


def test_failed_write_on_a_full_disk_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(number: int) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "state").write_bytes(b"before")
    monkeypatch.setattr("gateway.system.files.os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        replace_file(tmp_path / "state", b"after")
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"before"]
