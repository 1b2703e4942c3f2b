"""Where state is kept on this computer, and how a file is replaced in one step."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def directory(configured: str | None = None) -> Path:
    """Where state is kept: as configured, else systemd's ``STATE_DIRECTORY``, else the user's own place for it."""
    given = configured or os.environ.get("STATE_DIRECTORY", "").split(":" if os.name == "posix" else os.pathsep)[0]
    return Path(given).expanduser() if given else Path(platformdirs.user_state_path("mount-gateway", appauthor=False))


def write_whole(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Replace a file in one step, readable for its user only. Raises OSError.

    With ``flush`` it survives a power cut at any instant, too; without, a killed process only, in a fraction of the
    time. There is one writer for a path, so what a killed one left beside it is simply overwritten.
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
    """Have the names in a folder outlive a power cut, where the system can be asked for that. Raises OSError."""
    if os.name == "posix":
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
