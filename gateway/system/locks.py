"""Lock files that contain the process id of their holder.

The system releases a lock when its process ends for any reason. A failed attempt does not change the file, and raises
LockHeld with the holder's id. A symbolic link is not followed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path

from gateway.system.runtime_folders import find_folders

LOCK_OFFSET = 1 << 30  # the byte that is locked on Windows: far behind the content, which others can then read


class LockHeld(Exception):
    """Raised if another process holds the lock; the text contains its process id if the file does."""

    def __init__(self, pid: int | None) -> None:
        super().__init__(f"process {pid}" if pid else "another process")


class PidLock:
    """A lock on the file ``path``, which contains the decimal id of the process that holds or last held it."""

    def __init__(self, path: Path, *, remove: bool = False) -> None:
        """With ``remove``, the file is deleted when the lock is released."""
        self.path, self._remove = path, remove
        self._descriptor: int | None = None
        #: Whether the file had content already; with ``remove``, only a holder that was killed leaves any.
        self.holder_was_killed = False

    def acquire(self) -> None:
        """Get the lock now. Raises LockHeld if another process has it, OSError if the file cannot be made or locked."""
        while self._descriptor is None:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
            try:
                status = os.fstat(descriptor)
                if not stat.S_ISREG(status.st_mode):
                    raise OSError(errno.EINVAL, "is not a file", str(self.path))
                if not _lock(descriptor):
                    raise LockHeld(read_pid(self.path))
                if os.fstat(descriptor).st_nlink:  # else the last holder has just deleted the file
                    self._descriptor, descriptor = descriptor, -1
            finally:
                if descriptor >= 0:
                    os.close(descriptor)
        self.holder_was_killed = os.fstat(self._descriptor).st_size > 0
        with contextlib.suppress(OSError):  # the disk is full, but the lock is held
            content = b"%d\n" % os.getpid()
            os.write(self._descriptor, content)
            os.ftruncate(self._descriptor, len(content))

    def release(self) -> None:
        """Release the lock if it is held. Unless it is removed, the file still contains the id of this process."""
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is None:
            return
        if self._remove:
            with contextlib.suppress(OSError):
                os.unlink(self.path)
        os.close(descriptor)


def read_pid(path: Path) -> int | None:
    """Return the process id in a lock file; None if the file cannot be read or contains none."""
    with contextlib.suppress(OSError, ValueError):
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            return int(os.read(descriptor, 32)) or None
        finally:
            os.close(descriptor)
    return None


def _lock(descriptor: int) -> bool:
    """Lock an open file. Return False if another process holds the lock."""
    try:
        import fcntl
    except ImportError:
        return _lock_windows(descriptor)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK):
            return False
        raise
    return True


def _lock_windows(descriptor: int) -> bool:
    import msvcrt

    os.lseek(descriptor, LOCK_OFFSET, os.SEEK_SET)
    try:
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EDEADLK):
            return False
        raise
    finally:
        os.lseek(descriptor, 0, os.SEEK_SET)
    return True


class NameClaim:
    """A name that one process of this user can hold at a time, through a lock file in each of its runtime folders.
    Raises LockHeld if another process holds the name, and OSError if no folder is usable.
    """

    def __init__(self, name: str) -> None:
        usable, reasons = find_folders()
        if not usable:
            raise OSError(errno.EACCES, "; ".join(reasons))
        self._locks: list[PidLock] = []
        try:
            for folder in usable:
                lock = PidLock(folder / f"{name}.lock", remove=True)
                lock.acquire()
                self._locks.append(lock)
        except (LockHeld, OSError):
            self.release()
            raise

    @property
    def holder_was_killed(self) -> bool:
        """Whether a process of this user held the name and was killed."""
        return any(lock.holder_was_killed for lock in self._locks)

    def release(self) -> None:
        """Release the name, so that another process can hold it."""
        while self._locks:
            self._locks.pop().release()
