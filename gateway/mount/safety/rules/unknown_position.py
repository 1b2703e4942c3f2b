"""A mount that moves by hand and does not tell where it is: no limit can be watched, so the motion ends, seen or not.

An LX200GPS that seeks its home is busy and tells nothing; it is not moved by hand meanwhile.
"""

from __future__ import annotations

from gateway.mount.motion.wanted import Moving

#: How old the last position may be when the next one is not told, seconds; and from one stop for that to the next.
BLIND = 1.0


def blind(moving: Moving, age: float, since_stop: float) -> str:
    """-> why it must stop, or nothing. ``age`` is that of the last position."""
    if moving.by_hand and age > BLIND and since_stop > BLIND:
        return "it moves and does not tell where it is"
    return ""
