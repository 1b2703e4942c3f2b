"""Reply times: how long replies take on this line, the timeout that follows from it, and which replies may come late.

A serial line and a TCP stream preserve order, so a check that finds the line in step also rules out replies to older
requests. But some converters between gateway and mount reorder the data. Therefore a request that timed out stays open
until its reply would be later than any ever observed, and until then nothing is accepted that could be its reply.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.protocols.base.driver import Send

#: Seconds after its timeout within which the reply to a request may still arrive.
LATE_REPLIES_WITHIN = 2.5
#: The timeout of a position read: this multiple of the typical time, at least so many seconds, after so many replies.
POSITION_FACTOR, SHORTEST_TIMEOUT, ENOUGH_REPLIES = 8.0, 1.2, 20
#: After a late reply the timeouts grow to LATE_FACTOR times its seconds, unless it took longer than LATEST_COUNTED.
LATE_FACTOR, LATEST_COUNTED = 1.5, 6.0
#: The first reply sets the typical time, up to this many seconds.
FIRST_ANSWER = 1.0
#: Smoothing of the typical time: weight of the newest reply, which is cut to FACTOR times the average plus MARGIN.
WEIGHT, FACTOR, MARGIN = 0.2, 3.0, 0.01


class ReplyTimes:
    """``typical_rtt`` is the average round-trip time in seconds, ``last_rtt`` that of the last reply (or the wait for
    one), ``answers`` the number of replies.
    """

    def __init__(self) -> None:
        self.typical_rtt, self.last_rtt, self.answers = 0.02, 0.0, 0
        #: Seconds that the last late reply took; 0 if there was none.
        self._late = 0.0

    def answered(self, took: float, elapsed: float, counts: bool) -> None:
        """Record a reply. ``took`` is the time until its last byte, ``elapsed`` until it was accepted. It enters the
        average only if it ``counts``: replies to long operations and empty replies do not.
        """
        self.last_rtt = took
        self.answers += 1
        if not counts:
            return
        self.typical_rtt += WEIGHT * (min(elapsed, FACTOR * self.typical_rtt + MARGIN) - self.typical_rtt)
        if self.answers == 1:
            self.typical_rtt = max(self.typical_rtt, min(elapsed, FIRST_ANSWER))

    def unanswered(self, elapsed: float) -> None:
        """Record a timeout."""
        self.last_rtt = elapsed

    def came_late(self, took: float) -> None:
        """Record a reply that arrived after its timeout."""
        self._late = took if took <= LATEST_COUNTED else self._late

    def timeout(self, longest: float, position: bool) -> float:
        """Return the timeout of a reply in seconds; ``longest`` is the protocol's. It is shorter for a ``position``,
        which is polled: a lost reply is soon noticed and asked for again.
        """
        longest = max(longest, LATE_FACTOR * self._late)
        if not position or self.answers < ENOUGH_REPLIES:
            return longest
        return min(longest, max(SHORTEST_TIMEOUT, POSITION_FACTOR * self.typical_rtt))


class LateReplies:
    """Requests that timed out and may still be answered; ``ambiguous_with``: one reply could be taken for the other."""

    def __init__(self, ambiguous_with: Callable[[Send, Send], bool]) -> None:
        self._ambiguous_with = ambiguous_with
        self._open: list[tuple[float, Send]] = []

    def add(self, command: Send, until: float) -> None:
        """Keep an unanswered request open until this time of the line's clock, in seconds."""
        self._open.append((until, command))

    def until(self, command: Send, now: float) -> float:
        """Return the time from which no late reply can be mistaken for that of this command; ``now`` if none can."""
        return max([end for end, _ in self._like(command, now)], default=now)

    def count(self, command: Send, now: float) -> int:
        """Return how many late replies could be mistaken for that of this command; one more must be its own."""
        return len(self._like(command, now))

    def _like(self, command: Send, now: float) -> list[tuple[float, Send]]:
        if not self._open:
            return []
        self._open = [(end, other) for end, other in self._open if end > now]
        return [(end, other) for end, other in self._open if self._ambiguous_with(command, other)]
