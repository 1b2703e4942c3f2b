"""Locks by which one process has something to itself, with the number of that process in the file.

The system lets go of a lock when its process ends, however it ends. The file is never emptied by somebody who only
tries, is not followed where it is a link, and says whose it is to whoever is refused.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path

from gateway.system.runtime_folders import folders

#: Windows locks bytes, and nobody else may read those: one far behind what is written.
FAR = 1 << 30


class Taken(Exception):
    """Somebody else has it: the number of the process, where the file tells it."""

    def __init__(self, pid: int | None) -> None:
        super().__init__(f"process {pid}" if pid else "another process")


class PidLock:
    """``path`` is the file; in it is the decimal number of the process that had the lock last, or has it."""

    def __init__(self, path: Path, *, remove: bool = False) -> None:
        """``remove``: the file goes with the lock."""
        self.path, self._remove = path, remove
        self._number: int | None = None
        #: Whether the file was there already, left over by a process that did not end by itself.
        self.left = False

    def acquire(self) -> None:
        """Take it, without waiting. Raises Taken, and OSError where there can be no such file."""
        while self._number is None:
            number = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
            try:
                seen = os.fstat(number)
                if not stat.S_ISREG(seen.st_mode):
                    raise OSError(errno.EINVAL, "is not a file", str(self.path))
                if not _lock(number):
                    raise Taken(read_pid(self.path))
                if os.fstat(number).st_nlink:  # else its last holder took the file away just now
                    self._number, number = number, -1
            finally:
                if number >= 0:
                    os.close(number)
        self.left = os.fstat(self._number).st_size > 0
        with contextlib.suppress(OSError):  # a full disk: the lock holds all the same
            told = b"%d\n" % os.getpid()
            os.write(self._number, told)
            os.ftruncate(self._number, len(told))

    def release(self) -> None:
        """Let go of it, if it is held. A file that stays goes on naming this process, until another one has it."""
        number, self._number = self._number, None
        if number is None:
            return
        if self._remove:
            with contextlib.suppress(OSError):
                os.unlink(self.path)
        os.close(number)


def read_pid(path: Path) -> int | None:
    with contextlib.suppress(OSError, ValueError):
        number = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        try:
            return int(os.read(number, 32)) or None
        finally:
            os.close(number)
    return None


def _lock(number: int) -> bool:
    """Lock an open file -> whether it could be had."""
    try:
        import fcntl
    except ImportError:
        return _lock_windows(number)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN, errno.EWOULDBLOCK):
            return False
        raise
    return True


def _lock_windows(number: int) -> bool:
    import msvcrt

    os.lseek(number, FAR, os.SEEK_SET)
    try:
        msvcrt.locking(number, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EDEADLK):
            return False
        raise
    finally:
        os.lseek(number, 0, os.SEEK_SET)
    return True


class Claim:
    """A name that one process of this user has at a time, whatever folders each of them finds.

    Raises Taken, and OSError with all reasons where there is no folder that could be used.
    """

    def __init__(self, name: str) -> None:
        usable, reasons = folders()
        if not usable:
            raise OSError(errno.EACCES, "; ".join(reasons))
        self._locks: list[PidLock] = []
        try:
            for folder in usable:
                lock = PidLock(folder / f"{name}.lock", remove=True)
                lock.acquire()
                self._locks.append(lock)
        except (Taken, OSError):
            self.release()
            raise

    @property
    def left(self) -> bool:
        """Whether a process of this user had it and was killed."""
        return any(lock.left for lock in self._locks)

    def release(self) -> None:
        """Others may have it."""
        while self._locks:
            self._locks.pop().release()
