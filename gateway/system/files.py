"""Finds the folders for state files and caches, opens only regular files, and replaces files atomically."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
import sys
from pathlib import Path
from typing import BinaryIO

#: The user's folders on Linux: platformdirs' name, the variable that overrides it, and the default below HOME.
_LINUX_PATHS = {"user_state_path": ("XDG_STATE_HOME", ".local/state"), "user_cache_path": ("XDG_CACHE_HOME", ".cache")}
NOT_REGULAR_FILE = "this is a pipe or a device, and a plain file is needed: name another one"


def state_folder(configured: str | None = None) -> Path:
    """Return the state folder: as configured, else systemd's ``STATE_DIRECTORY``, else in the user's home."""
    given = configured or _systemd_folder("STATE_DIRECTORY")
    return Path(given).expanduser() if given else _user_folder("user_state_path")


def cache_folder() -> Path:
    """Return the cache folder: systemd's ``CACHE_DIRECTORY``, else in the user's home."""
    given = _systemd_folder("CACHE_DIRECTORY")
    return Path(given) if given else _user_folder("user_cache_path")


def _user_folder(function_name: str) -> Path:
    """Return the user's folder for state or cache; on Linux without importing platformdirs, which takes 10 ms."""
    home = os.environ.get("HOME", "")
    if sys.platform == "linux" and home.startswith("/"):
        variable, usual = _LINUX_PATHS[function_name]
        given = os.environ.get(variable, "")
        return Path(given if given.startswith("/") else f"{home}/{usual}", "mount-gateway")
    import platformdirs

    return Path(getattr(platformdirs, function_name)("mount-gateway", appauthor=False))


def _systemd_folder(variable: str) -> str:
    """Return the first folder in an environment variable that systemd sets; empty if it is not set."""
    return os.environ.get(variable, "").split(":" if os.name == "posix" else os.pathsep)[0]


def open_regular_fd(path: Path, flags: int = os.O_RDONLY, mode: int = 0o600) -> int:
    """Open a regular file and return its descriptor. Raises OSError for a pipe, a device or a folder.
    Opening a pipe would block until its other end is open, even for signals; a device such as /dev/zero never ends.
    """
    try:
        descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0), mode)
    except OSError as error:
        if error.errno == errno.ENXIO:  # a pipe that nobody reads, or a socket
            raise OSError(errno.EINVAL, NOT_REGULAR_FILE) from None
        raise
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind):
        return descriptor
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
    raise OSError(errno.EINVAL, NOT_REGULAR_FILE)


def open_regular_file(path: Path) -> BinaryIO:
    """Open a regular file for reading. Raises OSError if it is a pipe, a device or a folder, or cannot be opened."""
    return open(open_regular_fd(path), "rb")


def replace_file(path: Path, data: bytes, *, flush: bool = True) -> None:
    """Replace a file, readable for its user only, so that it has either the old or the new content. Raises OSError.
    With ``flush``, this holds even after a power cut. Without, it holds if the process is killed, and is much faster.
    Each path has one writer, so an unfinished file of a killed writer is replaced.
    """
    beside = path.with_name(f".{path.name}.new")
    descriptor = open_regular_fd(beside, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    try:
        with open(descriptor, "wb") as file:
            file.write(data)
            if flush:
                file.flush()
                os.fsync(file.fileno())
        os.replace(beside, path)
    except OSError:  # on a full disk, the unfinished file takes the last room
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    if flush:
        flush_folder(path.parent)


def flush_folder(folder: Path) -> None:
    """Write the entries of a folder to the disk, so that they survive a power cut; only on POSIX. Raises OSError."""
    if os.name == "posix":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
