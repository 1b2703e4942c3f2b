"""The folder for state files, and replacing a file atomically."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def directory(configured: str | None = None) -> Path:
    """Return the state folder: as configured, else systemd's ``STATE_DIRECTORY``, else the user's own."""
    given = configured or os.environ.get("STATE_DIRECTORY", "").split(":" if os.name == "posix" else os.pathsep)[0]
    return Path(given).expanduser() if given else Path(platformdirs.user_state_path("mount-gateway", appauthor=False))


def replace_file(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Replace a file atomically, readable for its user only. Raises OSError.

    With ``flush`` the file survives a power cut at any instant; without it only a killed process, in a fraction of the
    time. Each path has one writer, so what a killed one left is simply overwritten.
    """
    beside = path.with_name(f".{path.name}.new")
    number = os.open(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with open(number, "wb") as file:
        file.write(data)
        if flush:
            file.flush()
            os.fsync(file.fileno())
    os.replace(beside, path)
    if flush:
        flush_folder(path.parent)


def flush_folder(folder: Path) -> None:
    """Make the names in a folder survive a power cut, if the system supports that. Raises OSError."""
    if os.name == "posix":
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
