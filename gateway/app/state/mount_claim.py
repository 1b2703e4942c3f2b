"""A lock for a mount behind a network address, so that a second gateway is refused as it is on a serial port.

The system locks a serial port, but not a network address. The lock is named by the address, so that another state
folder, another protocol or ``rfc2217://`` instead of ``socket://`` makes no difference.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from urllib.parse import urlsplit

from gateway.app.config import Endpoint
from gateway.core.errors import UserError
from gateway.system.locks import LockHeld, NameClaim

NETWORK_SCHEMES = ("socket", "rfc2217", "http")
#: Names and addresses that all mean this computer.
LOCAL_HOSTS = ("localhost", "::1", "0.0.0.0", "::")


class MountTaken(UserError):
    """Another gateway has the mount; ``holder`` names its process, such as ``process 17``."""

    def __init__(self, text: str, holder: str) -> None:
        super().__init__(text)
        self.holder = holder


def claim_mount(mount: Endpoint, warn: Callable[[str], None]) -> NameClaim | None:
    """Take the lock of a mount until it is released; return None for a mount that has no network address.

    Without a folder for locks, ``warn`` gets a message and no lock is taken. Raises MountTaken if the mount is in use.
    """
    name = lock_name(mount.where)
    try:
        return None if name is None else NameClaim(name)
    except LockHeld as by:
        raise MountTaken(taken_message(str(mount), str(by)), str(by)) from None
    except OSError as error:
        warn(f"{mount}: a second gateway on the same mount would not be noticed: {error.strerror}")
        return None


def taken_message(mount: str, holder: str) -> str:
    """Return the message for a mount that another gateway has; ``holder`` is its process."""
    return f"{mount}: another gateway ({holder}) already drives this mount; connect programs to its surfaces"


def lock_name(where: str) -> str | None:
    """Return the name of a mount's lock, made from host and port; None if it has no network address."""
    try:
        url = urlsplit(where)
        host, port = url.hostname, url.port
    except ValueError:
        return None
    if url.scheme not in NETWORK_SCHEMES or not host or port is None:
        return None
    host = "127.0.0.1" if host in LOCAL_HOSTS else host
    number = url.path.strip("/").lstrip("0")  # of a server with several mounts
    return f"mount_{re.sub(r'[^a-z0-9.-]+', '_', host)[:100]}_{port}{number and f'_{number}'}"
