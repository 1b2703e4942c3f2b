"""What a surface wants to be told of without being asked: a reading, how often, and the bytes that it makes of it.

A reply answers a command; what is pushed answers none. A subscription begins with the connection and ends with it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from gateway.core.operations import Read


class Subscription(NamedTuple):
    """``operation`` is read ``every`` so many seconds, and ``encode`` makes bytes of what it tells; empty: nothing.

    With ``changes`` the same bytes are not sent twice in a row. What the other side has not taken yet is not piled up:
    it gets the newest when it reads again. While the mount does not tell, nothing is sent. The first comes ``after`` so
    many seconds of the connection.
    """

    operation: Read
    every: float
    encode: Callable[[Any], bytes]
    changes: bool = False
    after: float = 0.0
