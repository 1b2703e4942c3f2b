"""Folders for files that exist while a process runs: locks, and the files in which gateways announce themselves.

Missing folders are created. They belong to this user and are closed to others, so that no other user can predict,
occupy or replace a name in them. There may be two: a folder of the session (``XDG_RUNTIME_DIR``), and a folder in the
temporary folder, which every process of the user finds. Files are written to both, and searched in both. A folder of
another user is never used, but reported. If neither is usable, a folder in the state folder is used.
"""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path

from gateway.system.files import state_folder

#: The name of a runtime folder, and of the folder in the state folder that replaces it.
FOLDER_NAME, FALLBACK_FOLDER_NAME = "mount-gateway", "run"
#: Where systemd keeps the runtime folders of sessions.
SESSIONS_FOLDER = Path("/run/user")


def find_folders() -> tuple[list[Path], list[str]]:
    """Return the usable folders, and for every other folder why it is not usable."""
    usable: list[Path] = []
    reasons: list[str] = []
    for folder in [*candidate_folders(), state_folder() / FALLBACK_FOLDER_NAME]:
        if folder.name == FALLBACK_FOLDER_NAME and usable:
            break
        reason = _reason_unusable(folder)
        if reason:
            reasons.append(f"{folder}: {reason}")
        else:
            usable.append(folder)
    return usable, reasons


def candidate_folders() -> Iterator[Path]:
    """Yield the possible runtime folders of this user."""
    session = os.environ.get("XDG_RUNTIME_DIR", "")
    if session and _owner_id(Path(session)) == user_id():
        yield Path(session, FOLDER_NAME)
    yield temp_folder() / (FOLDER_NAME if user_id() is None else f"{FOLDER_NAME}-{user_id()}")


def temp_folder() -> Path:
    """Return the temporary folder; on POSIX without ``tempfile``, which chooses another folder if the disk is full."""
    if os.name == "posix":
        return Path(os.environ.get("TMPDIR") or "/tmp")
    import tempfile

    return Path(tempfile.gettempdir())


def user_id() -> int | None:
    """Return the id of this user; None if the system has none (Windows)."""
    return os.getuid() if hasattr(os, "getuid") else None


def folders_of_others() -> list[tuple[Path, int]]:
    """Return the runtime folders of all other users with the users' ids; empty unless this user is root."""
    if user_id() != 0:
        return []
    present = [*temp_folder().glob(f"{FOLDER_NAME}-*"), *SESSIONS_FOLDER.glob(f"*/{FOLDER_NAME}")]
    owned = [(folder, _owner_id(folder)) for folder in sorted(present)]
    return [(folder, owner) for folder, owner in owned if owner]


def protect_from_cleanup(folder: Path) -> int | None:
    """Lock a folder, so that systemd-tmpfiles(8) does not remove old files from it. Return the lock's descriptor,
    to close when the folder is used no more; None if it cannot be opened, or on Windows.
    """
    try:
        import fcntl
    except ImportError:
        return None
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    with contextlib.suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    return descriptor


def _owner_id(folder: Path) -> int | None:
    """Return the user id of a directory's owner; None for anything else, also for a link."""
    try:
        status = os.lstat(folder)
    except OSError:
        return None
    return status.st_uid if stat.S_ISDIR(status.st_mode) else None


def _reason_unusable(folder: Path) -> str:
    """Create a folder if it is missing. Return why it cannot be used; empty if it can."""
    try:
        if folder.name == FALLBACK_FOLDER_NAME:
            folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            os.mkdir(folder, 0o700)
        status = os.lstat(folder)
    except OSError as error:
        return error.strerror or str(error)
    if not stat.S_ISDIR(status.st_mode):
        return "is not a directory"
    if user_id() is None:
        return ""
    if status.st_uid != user_id():
        return f"belongs to {user_name(status.st_uid)}, not to you"
    if status.st_mode & 0o077:
        return "is open to other users; chmod 700 closes it"
    return ""


def user_name(uid: int) -> str:
    try:
        import pwd

        return f"the user {pwd.getpwuid(uid).pw_name}"
    except (ImportError, KeyError):
        return f"user number {uid}"
