"""When answers come: how long the mount takes on this line, how long an answer is waited for, and which may come late.

A serial line and a TCP stream keep the order of what passes, so an exchange that proves the line to be in step also
ends every older request. Some boxes in between reorder all the same. For them a request stays open until its reply
would be later than any that was ever seen, and nothing is accepted that could be its reply.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.protocols.base.driver import Send

#: Seconds after its timeout within which the answer to a question may still come.
LATEST = 2.5
#: A place is missed after so many times what answers take, and no sooner than these seconds, once so many have come.
QUICK, SOON, KNOWN = 8.0, 1.2, 20
#: Where an answer has come too late, and no later than these seconds, the next are waited for so much longer.
LATER, LATEST_ANSWER = 1.5, 6.0
#: The first answer tells how long answers take, up to so many seconds.
FIRST_ANSWER = 1.0
#: How much the newest answer counts, and what it may differ at most.
SHARE, FACTOR, AT_LEAST = 0.2, 3.0, 0.01


class AnswerTimes:
    """``typical`` and ``took`` are the seconds that an answer takes, and that the last one took on the wire;
    ``answers`` how many there were.
    """

    def __init__(self) -> None:
        self.typical, self.took, self.answers = 0.02, 0.0, 0
        #: How late an answer came once, seconds; 0 where none has.
        self._late = 0.0

    def answered(self, took: float, elapsed: float, counts: bool) -> None:
        """An answer has come, ``elapsed`` seconds after its question; ``counts``: it is no long work, nor empty."""
        self.took = took
        self.answers += 1
        if not counts:
            return
        self.typical += SHARE * (min(elapsed, FACTOR * self.typical + AT_LEAST) - self.typical)
        if self.answers == 1:
            self.typical = max(self.typical, min(elapsed, FIRST_ANSWER))

    def unanswered(self, elapsed: float) -> None:
        """None has come."""
        self.took = elapsed

    def came_late(self, took: float) -> None:
        """It came after nobody waited for it any more."""
        self._late = took if took <= LATEST_ANSWER else self._late

    def patience(self, longest: float, place: bool) -> float:
        """Seconds that an answer may take, ``longest`` by the protocol. A ``place`` is asked for again and again: a
        lost one is soon missed.
        """
        longest = max(longest, LATER * self._late)
        if not place or self.answers < KNOWN:
            return longest
        return min(longest, max(SOON, QUICK * self.typical))


class LateReplies:
    """The unanswered questions. ``alike`` says whether an answer to the one could be taken for one to the other."""

    def __init__(self, alike: Callable[[Send, Send], bool]) -> None:
        self._alike = alike
        self._open: list[tuple[float, Send]] = []

    def add(self, ask: Send, until: float) -> None:
        """A question stays open until then, in seconds of the line's clock."""
        self._open.append((until, ask))

    def until(self, ask: Send, now: float) -> float:
        """When nothing but the answer to ``ask`` can be taken for it; ``now`` when that is so already."""
        return max([end for end, _ in self._like(ask, now)], default=now)

    def count(self, ask: Send, now: float) -> int:
        """How many answers may come that could be taken for the answer to ``ask``: one more than that is its own."""
        return len(self._like(ask, now))

    def _like(self, ask: Send, now: float) -> list[tuple[float, Send]]:
        if not self._open:
            return []
        self._open = [(end, other) for end, other in self._open if end > now]
        return [(end, other) for end, other in self._open if self._alike(ask, other)]
