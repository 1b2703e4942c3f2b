"""A name in the file system that stands for a device, and that one gateway holds at a time.

The name is a symbolic link. One that a crash has left over is replaced, because nobody holds its lock any more; a link
to anything but a pseudo-terminal, and a file of any other kind, is somebody's own and stays.
"""

from __future__ import annotations

import contextlib
import os
import zlib

from gateway.errors import UserError

#: Where pseudo-terminals are, on Linux and on macOS.
TERMINALS = ("/dev/pts/", "/dev/ttys")
#: Who may use serial ports: Debian's group, and that of Arch and the BSDs.
GROUPS = ("dialout", "uucp")


class Link:
    """``path``, absolute and held until ``close``. Raises UserError."""

    def __init__(self, path: str) -> None:
        self.path = os.path.abspath(os.path.expanduser(path))
        self._target = ""
        folder = os.path.dirname(self.path)
        if not os.path.isdir(folder):
            raise UserError(f"cannot make {self.path}: there is no directory {folder}")
        self._lock_name, self._lock = _lock_for(self.path)

    def point(self, target: str) -> None:
        """Let the name stand for a device, at once and in the place of an older link. Raises UserError."""
        old = os.readlink(self.path) if os.path.islink(self.path) else ""
        if os.path.exists(self.path) and not old.startswith(TERMINALS):
            what = f"a link to {old}" if old else "a directory" if os.path.isdir(self.path) else "a file"
            raise UserError(f"cannot make {self.path}: there is {what} of that name already; it is left alone")
        draft = f"{self.path}.{os.getpid()}"
        try:
            os.symlink(target, draft)
            os.replace(draft, self.path)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.unlink(draft)
            raise UserError(f"cannot make {self.path}: {error.strerror}") from None
        self._target = target

    def close(self) -> None:
        """Remove the link, unless it has become somebody else's, and the lock with its file."""
        with contextlib.suppress(OSError):
            if self._target and os.readlink(self.path) == self._target:
                os.unlink(self.path)
        with contextlib.suppress(OSError):
            os.unlink(self._lock_name)
        os.close(self._lock)


def like_a_serial_port(device: str) -> None:
    """Mode 0660 and the group of serial ports, as far as this user may give a device away."""
    import grp

    with contextlib.suppress(OSError):
        os.chmod(device, 0o660)
    for group in GROUPS:
        with contextlib.suppress(KeyError, OSError):
            os.chown(device, -1, grp.getgrnam(group).gr_gid)
            return


def _lock_for(path: str) -> tuple[str, int]:
    """Hold a lock for a link's name, so that two gateways cannot share it. Raises UserError."""
    import fcntl
    import tempfile

    name = os.path.join(tempfile.gettempdir(), f"mount-gateway-{zlib.crc32(path.encode()):08x}.lock")
    while True:
        try:
            number = os.open(name, os.O_CREAT | os.O_RDWR, 0o666)
        except OSError as error:  # another user's, for one
            raise UserError(f"cannot make {path}: {name}: {error.strerror}") from None
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(number)
            raise UserError(f"cannot make {path}: another gateway holds it") from None
        if os.fstat(number).st_nlink:
            return name, number
        os.close(number)  # its holder took the file away just now
