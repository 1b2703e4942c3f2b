"""Late replies: requests that timed out and may still be answered.

A serial line and a TCP stream keep the order of what passes, so an exchange that proves the line to be in step also
ends every older request. Some boxes in between reorder all the same. For them a request stays open until its reply
would be later than any that was ever seen, and nothing is accepted that could be its reply.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.protocols.base.driver import Send

#: Seconds after its timeout within which the answer to a question may still come.
LATEST = 2.5


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
