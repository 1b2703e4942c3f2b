"""Detects loops of gateways: each gateway adds its token, a random text, to the description of its Alpaca server.

A gateway that finds its own token in the description of its mount's server would drive itself: it refuses that mount.
"""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Mapping
from functools import cache
from typing import Any

#: The name of every gateway's server.
SERVER_NAME = "mount-gateway"
#: The key of the description whose value is the list of tokens. Programs ignore unknown keys.
TOKENS_MEMBER = "Gateways"
#: Address of a mount's server -> the tokens of the gateways behind it.
_tokens: dict[str, list[str]] = {}


@cache
def own_token(process_id: int) -> str:
    """Return the token of the process with this id. The parameter gives a forked process a token of its own."""
    return secrets.token_hex(8)


def tokens() -> list[str]:
    """Return the tokens of this gateway and of those through which it reaches its mounts."""
    return list(dict.fromkeys([own_token(os.getpid()), *(token for tokens in _tokens.values() for token in tokens)]))


def check_for_loop(address: str, description: Mapping[str, Any]) -> None:
    """Store the tokens in the description of a mount's server. Raises OSError if this gateway's is among them."""
    listed = description.get(TOKENS_MEMBER)
    behind = [token for token in listed if isinstance(token, str)] if isinstance(listed, list) else []
    if own_token(os.getpid()) in behind:
        raise OSError(errno.ELOOP, "the mount there is this very gateway, directly or through another one")
    _tokens[address] = behind
