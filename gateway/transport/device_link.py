"""A symbolic link to a device, at a path that only one gateway can use at a time.

A dangling link is replaced. So is a link that a killed gateway of this user left behind, as its lock file shows. Other
links, and files of any other kind, belong to other programs and are not changed.
"""

from __future__ import annotations

import contextlib
import os

from gateway.core.errors import UserError
from gateway.system.locks import LockHeld, NameClaim
from gateway.system.runtime_folders import user_id, user_name

#: Folders of pseudo-terminals, on Linux and on macOS.
TERMINAL_PREFIXES = ("/dev/pts/", "/dev/ttys")
#: Groups that may use serial ports: Debian's, and that of Arch and the BSDs.
SERIAL_PORT_GROUPS = ("dialout", "uucp")


class DeviceLink:
    """A symbolic link at ``path``, locked until ``close``. Raises UserError if the path cannot be used."""

    def __init__(self, path: str) -> None:
        self.path = os.path.abspath(os.path.expanduser(path))
        self._target = ""
        folder = os.path.dirname(self.path)
        if not os.path.isdir(folder):
            raise UserError(f"cannot make {self.path}: there is no directory {folder}")
        self._path_claim = _claim_path(self.path)

    def check_path(self) -> None:
        """Raise UserError if the path belongs to another program."""
        old = os.readlink(self.path) if os.path.islink(self.path) else ""
        if os.path.exists(self.path) and not old.startswith(TERMINAL_PREFIXES):
            what = f"a link to {old}" if old else "a directory" if os.path.isdir(self.path) else "a file"
            raise UserError(
                f"cannot make {self.path}: there is {what} of that name already: remove it, or choose another name"
            )
        if not old or old == self._target or not os.path.exists(old):
            return
        owner = os.lstat(self.path).st_uid
        if owner != user_id() or not self._path_claim.holder_was_killed:
            whose = "another program" if owner == user_id() else user_name(owner)
            raise UserError(
                f"cannot make {self.path}: {whose} has a link of that name to {old}, which is in use: choose "
                f"another name"
            )

    def create(self, target: str) -> None:
        """Create the link to a device, atomically replacing an older link. Raises UserError."""
        self.check_path()
        draft = f"{self.path}.{os.urandom(8).hex()}"  # a name that no other program can predict
        try:
            os.symlink(target, draft)
            os.replace(draft, self.path)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.unlink(draft)
            advice = (
                "; choose a folder that you may write to, such as /tmp" if isinstance(error, PermissionError) else ""
            )
            raise UserError(f"cannot make {self.path}: {error.strerror}{advice}") from None
        self._target = target

    def close(self) -> None:
        """Remove the link, unless another program has replaced it, and unlock its path."""
        with contextlib.suppress(OSError):
            if self._target and os.readlink(self.path) == self._target:
                os.unlink(self.path)
        self._path_claim.release()


def is_path_free(path: str) -> bool:
    """Whether a gateway could use this path. A link there is removed if it dangles, or a killed gateway left it."""
    try:
        link = DeviceLink(path)
    except UserError:
        return False
    try:
        link.check_path()
        if os.path.islink(link.path):
            os.unlink(link.path)
    except (UserError, OSError):
        return False
    finally:
        link.close()
    return True


def set_serial_permissions(device: str) -> None:
    """Set mode 0660 and the group of serial ports, as far as this user may."""
    import grp

    with contextlib.suppress(OSError):
        os.chmod(device, 0o660)
    for group in SERIAL_PORT_GROUPS:
        with contextlib.suppress(KeyError, OSError):
            os.chown(device, -1, grp.getgrnam(group).gr_gid)
            return


def _claim_path(path: str) -> NameClaim:
    """Lock the path of a link, so that no other gateway of this user uses it. Raises UserError."""
    try:
        import hashlib  # for programs on virtual serial ports only

        return NameClaim(f"link_{hashlib.sha256(os.fsencode(path)).hexdigest()[:32]}")
    except LockHeld as by:
        raise UserError(f"cannot make {path}: another gateway holds it ({by})") from None
    except OSError as error:
        raise UserError(f"cannot make {path}: no folder for its lock: {error.strerror}") from None
