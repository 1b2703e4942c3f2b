"""What the system says of a file is followed by what to do about it."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from gateway.core.errors import explain_file_error, explain_os_error


@pytest.mark.parametrize(
    ("number", "step"),
    [
        (errno.EACCES, "Permission denied; choose a folder that you may write to, or run this as its owner"),
        (errno.ENOSPC, "No space left on device; free space on that disk (df -h shows which is full), or choose a"),
        (errno.EROFS, "Read-only file system; choose a folder on a disk that can be written to"),
        (errno.EIO, "Input/output error"),
    ],
)
def test_system_error_message_gives_the_next_step(number: int, step: str) -> None:
    error = OSError(number, os.strerror(number))
    assert explain_os_error(error).startswith(step)
    assert explain_file_error("night.rec", error) == explain_os_error(error)


def test_permission_error_is_not_reported_as_a_missing_folder(tmp_path: Path) -> None:
    error = PermissionError(errno.EACCES, "Permission denied")
    words = explain_file_error(tmp_path / "gateway.toml", error, reading=True)
    assert words.startswith("Permission denied") and f"ls -l {tmp_path}/gateway.toml" in words
