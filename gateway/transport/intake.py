"""How fast bytes are read from connections that send without end, so that a flood costs no more than a few clients do.

A connection that has sent a whole share pauses. All of them together get a limited number of shares a second, one after
the other, and at most a fifth of the processor's time. Input that only repeats the ends of motions is skipped in large
pieces, a whole number of repetitions at a time: its sender may be long gone.
"""

from __future__ import annotations

from bisect import bisect_left

#: Bytes taken from a connection at a time: some hundred commands, a serial line's half second, two milliseconds' work.
SHARE = 512
#: Seconds that a connection waits which has sent a whole share at once, and between two such connections.
BREATH, APART = 0.05, 0.005
#: Of one that has been behind for so many seconds what comes is late: nobody knows when it was sent, and perhaps its
#: other side has closed long ago. Nothing of it begins a motion, and it is read without the breath.
LATE = 1.0
#: For so many times the seconds that a share has taken nobody else who sends without end is read.
OTHERS = 4.0
#: Bytes that are looked at together for a repetition.
SKIM = 65536
#: The last bytes of a share, by which it is found out where it begins anew.
TAIL = 16


class Pace:
    """When the connections of one port may go on."""

    def __init__(self) -> None:
        self._last = 0.0

    def pause(self, now: float, took: float, late: bool = False) -> float:
        """Seconds until a connection is read again that has sent a whole share, which took so many seconds to do.

        ``now`` is the event loop's time, ``late`` whether it has been behind for long.
        """
        self._last = max(now + (APART if late else BREATH), self._last + max(APART, OTHERS * took))
        return self._last - now


def period(share: bytes) -> int:
    """After how many bytes these begin anew; 0 when they do not within half of them."""
    end, tail = len(share) - 1, share[-TAIL:]
    while (begins := share.rfind(tail, 0, end)) >= 0:
        length = len(share) - TAIL - begins
        if length > len(share) // 2:
            return 0
        if share[length:] == share[:-length]:
            return length
        end = begins + TAIL - 1  # the tail stands more than once in what is repeated
    return 0


def unrepeated(share: bytes, more: bytes) -> bytes:
    """What remains of ``more`` when whole periods that repeat what was said before it are left out; one is kept."""
    length = period(share)
    if not length:
        return more
    expected = (share[-length:] * (len(more) // length + 1))[: len(more)]
    same = bisect_left(range(len(more)), True, key=lambda last: more[: last + 1] != expected[: last + 1])
    return more[max(0, same - length) // length * length :]
