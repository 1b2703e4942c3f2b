"""The gateways between a program and the mount: each adds its token to its server's description.

A gateway that finds its token in the description of its mount would drive itself; it refuses that mount.
"""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Mapping
from functools import cache
from typing import Any

#: The name of every gateway's server.
SERVER = "mount-gateway"
#: The member of the description that has the tokens. Programs ignore members that they do not know.
MEMBER = "Gateways"
#: Address of a mount's server -> the tokens of the gateways behind it.
_behind: dict[str, list[str]] = {}


@cache
def own_token(process: int) -> str:
    """Return the token of this process, which no process that it was forked from has."""
    return secrets.token_hex(8)


def tokens() -> list[str]:
    """Return the tokens of this gateway and of those through which it reaches its mounts."""
    return list(dict.fromkeys([own_token(os.getpid()), *(token for tokens in _behind.values() for token in tokens)]))


def check(where: str, description: Mapping[str, Any]) -> None:
    """Note the gateways behind a mount's server. Raises OSError if this gateway is among them."""
    listed = description.get(MEMBER)
    behind = [token for token in listed if isinstance(token, str)] if isinstance(listed, list) else []
    if own_token(os.getpid()) in behind:
        raise OSError(errno.ELOOP, "the mount there is this very gateway, directly or through another one")
    _behind[where] = behind
