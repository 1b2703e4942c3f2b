"""Limits how fast bytes are read from clients that send without pause: a flood costs no more than a few clients.

A connection that has sent a whole share is paused. All such connections together get a limited number of shares a
second, one after the other, and at most a fifth of the processor's time. Input that only repeats commands that end
motions is skipped in large pieces, a whole number of repetitions at a time; its sender may be gone long ago.
"""

from __future__ import annotations

from bisect import bisect_left

#: Bytes of one read: about a hundred commands, half a second of a serial line, two milliseconds of work.
SHARE = 512
#: Seconds that a connection is paused after a whole share, and seconds between the shares of two connections.
PAUSE, GAP = 0.05, 0.005
#: Seconds after which a connection that is behind is late: it is unknown when its bytes were sent, and its client may
#: have disconnected. They begin no motion, and it is read with the shorter pause.
LATE = 1.0
#: After a share, no other such connection is read for so many times the seconds that it took.
OTHERS = 4.0
#: Bytes that are searched for repetitions together.
LARGE_READ = 65536
#: Bytes at the end of a share that are searched for to find its period.
TAIL = 16


class Pace:
    """Decides when the connections of one port are read again."""

    def __init__(self) -> None:
        self._last = 0.0

    def pause(self, now: float, took: float, late: bool = False) -> float:
        """Return the seconds until a connection is read again after a whole share, which took ``took`` to process.

        ``now`` is the event loop's time, ``late`` whether the connection has been behind for long.
        """
        self._last = max(now + (GAP if late else PAUSE), self._last + max(GAP, OTHERS * took))
        return self._last - now


def period(share: bytes) -> int:
    """Return after how many bytes a share repeats itself; 0 if that is more than half of it."""
    end, tail = len(share) - 1, share[-TAIL:]
    while (begins := share.rfind(tail, 0, end)) >= 0:
        length = len(share) - TAIL - begins
        if length > len(share) // 2:
            return 0
        if share[length:] == share[:-length]:
            return length
        end = begins + TAIL - 1  # the tail occurs more than once in a period
    return 0


def skip_repetitions(share: bytes, more: bytes) -> bytes:
    """Remove from ``more`` the whole periods that repeat ``share``; one period is kept."""
    length = period(share)
    if not length:
        return more
    expected = (share[-length:] * (len(more) // length + 1))[: len(more)]
    same = bisect_left(range(len(more)), True, key=lambda last: more[: last + 1] != expected[: last + 1])
    return more[max(0, same - length) // length * length :]
