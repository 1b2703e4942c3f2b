"""The outcomes of orders that somebody may wait for: done with an answer, refused, or over before they were done.

One future an order. What is not wanted any more is cancelled, which whoever waits hears as ``Stopped``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any

from gateway.core.errors import Stopped
from gateway.core.shared_work import heed, result_of
from gateway.mount.motion.wanted import Order

Outcome = asyncio.Future[Any]


class Awaited:
    """By the numbers of orders."""

    def __init__(self) -> None:
        self._outcomes: dict[int, Outcome] = {}

    def expect(self, number: int) -> None:
        """This order was taken."""
        self._outcomes[number] = _new()

    def of(self, number: int) -> Outcome | None:
        """What whoever gave the order waits for; None where nobody can."""
        return self._outcomes.get(number)

    def take(self, number: int) -> Outcome | None:
        """The same, to be decided now."""
        return self._outcomes.pop(number, None)

    def keep(self, number: int, outcome: Outcome | None) -> None:
        """It is not decided after all."""
        if outcome is not None:
            self._outcomes[number] = outcome

    def not_wanted(self, orders: Iterable[Order]) -> None:
        """These are over; the release of an arrow that was over before is done."""
        for order in orders:
            outcome = self._outcomes.pop(order.number, None)
            if outcome is None:
                continue
            if order.unless:
                outcome.set_result(None)
            else:
                outcome.cancel()


def _new() -> Outcome:
    outcome: Outcome = asyncio.get_running_loop().create_future()
    outcome.add_done_callback(heed)
    return outcome


def done() -> Outcome:
    """The outcome of what needs nothing to be done."""
    outcome = _new()
    outcome.set_result(None)
    return outcome


def refused(fault: Exception) -> Outcome:
    """The outcome of what is not taken."""
    outcome = _new()
    outcome.set_exception(fault)
    return outcome


def over_before() -> Outcome:
    """The outcome of what was over before it came."""
    outcome = _new()
    outcome.cancel()
    return outcome


async def ended(outcome: Outcome) -> Any:
    """Wait for an outcome; who gives up ends it for nobody. Raises Fault, and Stopped where it is over undone."""
    try:
        return await result_of(outcome)
    except asyncio.CancelledError:
        if outcome.cancelled():
            raise Stopped from None
        raise
