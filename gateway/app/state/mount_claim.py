"""One gateway for a mount behind a network address: the second is refused, as it is for a serial port.

A serial port is the system's to give away, a network address is not. The lock is named by the address, so that another
state folder, another protocol or ``rfc2217://`` for ``socket://`` makes no difference.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from urllib.parse import urlsplit

from gateway.app.config import Endpoint
from gateway.core.errors import UserError
from gateway.system.locks import Claim, Taken

SCHEMES = ("socket", "rfc2217")
#: What a port of this computer is written as.
HERE = ("localhost", "::1", "0.0.0.0", "::")


def claim(mount: Endpoint, warn: Callable[[str], None]) -> Claim | None:
    """Held until it is released; None for a mount that has no network address.

    Without a folder for locks the mount is served all the same: ``warn`` is told why nobody else can be kept away.
    Raises UserError where another gateway has this mount.
    """
    name = address(mount.where)
    try:
        return None if name is None else Claim(name)
    except Taken as by:
        raise UserError(
            f"{mount}: another gateway ({by}) has this mount already; programs that use the same mount "
            "connect to that one's surfaces"
        ) from None
    except OSError as error:
        warn(f"{mount}: a second gateway on the same mount would not be noticed: {error.strerror}")
        return None


def address(where: str) -> str | None:
    """What the lock of a mount is called, by host and port; None for what is no network address."""
    try:
        url = urlsplit(where)
        host, port = url.hostname, url.port
    except ValueError:
        return None
    if url.scheme not in SCHEMES or not host or port is None:
        return None
    host = "127.0.0.1" if host in HERE else host
    return f"mount_{re.sub(r'[^a-z0-9.-]+', '_', host)[:100]}_{port}"
