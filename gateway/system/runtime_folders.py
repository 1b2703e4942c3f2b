"""Folders for what lives as long as a process: locks, and how a gateway can be reached.

They are made where they are absent, belong to this user and are closed to all others, so that nobody else can foresee,
take or replace a name in them. There may be two: what a session has (``XDG_RUNTIME_DIR``), and one in the temporary
folder, which every process of a user finds. What is written goes to all of them, what is looked for is looked for in
all of them. A folder that is not this user's own is never used, and it is said why; when somebody has taken both names
beforehand, there is a third place, in the state folder, where nobody can.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from gateway.system.files import directory

#: What they are called, and the one in the state folder.
NAME, LAST = "mount-gateway", "run"
#: Where systemd keeps the runtime folders of sessions.
SESSIONS = Path("/run/user")


def folders() -> tuple[list[Path], list[str]]:
    """Those that can be used, and for every other one that was tried why not."""
    usable: list[Path] = []
    reasons: list[str] = []
    for folder in [*candidates(), directory() / LAST]:
        if folder.name == LAST and usable:
            break
        reason = _unfit(folder)
        if reason:
            reasons.append(f"{folder}: {reason}")
        else:
            usable.append(folder)
    return usable, reasons


def candidates() -> Iterator[Path]:
    """Where a folder of this user's could be."""
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if session and _owner(Path(session)) == user():
        yield Path(session, NAME)
    yield temporary() / (NAME if user() is None else f"{NAME}-{user()}")


def temporary() -> Path:
    """The temporary folder. Not by ``tempfile``, which tries to write and goes elsewhere when the disk is full."""
    if os.name == "posix":
        return Path(os.environ.get("TMPDIR") or "/tmp")
    import tempfile

    return Path(tempfile.gettempdir())


def user() -> int | None:
    """The number of this user; None where the system has none (Windows)."""
    return os.getuid() if hasattr(os, "getuid") else None


def of_others() -> list[tuple[Path, int]]:
    """The folders of all other users with the users' numbers: only root may look into them."""
    if user() != 0:
        return []
    found = [*temporary().glob(f"{NAME}-*"), *SESSIONS.glob(f"*/{NAME}")]
    owned = [(folder, _owner(folder)) for folder in sorted(found)]
    return [(folder, owner) for folder, owner in owned if owner]


def occupy(folder: Path) -> int | None:
    """Keep a temporary folder from being cleaned up by its age -> a descriptor to be closed at the end, if any.

    systemd-tmpfiles(8) leaves alone what lies in a directory on which somebody has a lock.
    """
    try:
        import fcntl
    except ImportError:
        return None
    try:
        number = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    with contextlib.suppress(OSError):
        fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
    return number


def _owner(folder: Path) -> int | None:
    """Whose directory it is; None for what is none, or a link."""
    try:
        seen = os.lstat(folder)
    except OSError:
        return None
    return seen.st_uid if stat.S_ISDIR(seen.st_mode) else None


def _unfit(folder: Path) -> str:
    """Make a folder where it is absent -> why it cannot be used, or nothing."""
    try:
        if folder.name == LAST:
            folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            os.mkdir(folder, 0o700)
        seen = os.lstat(folder)
    except OSError as error:
        return error.strerror or str(error)
    if not stat.S_ISDIR(seen.st_mode):
        return "is not a directory"
    if user() is None:
        return ""
    if seen.st_uid != user():
        return f"belongs to {user_name(seen.st_uid)}, not to you"
    if seen.st_mode & 0o077:
        return "is open to other users; chmod 700 closes it"
    return ""


def user_name(number: int) -> str:
    try:
        import pwd

        return f"the user {pwd.getpwuid(number).pw_name}"
    except (ImportError, KeyError):
        return f"user number {number}"
