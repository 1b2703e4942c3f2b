"""The outcomes of orders that somebody may wait for: done with an answer, refused, or over before they were done.

One future an order. What is not wanted any more is cancelled, which whoever waits hears as ``Stopped``.
"""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.core.shared_work import heed

Outcome = asyncio.Future[Any]


def new() -> Outcome:
    """That of an order that was taken."""
    outcome: Outcome = asyncio.get_running_loop().create_future()
    outcome.add_done_callback(heed)
    return outcome


def done() -> Outcome:
    """The outcome of what needs nothing to be done."""
    outcome = new()
    outcome.set_result(None)
    return outcome


def refused(fault: Exception) -> Outcome:
    """The outcome of what is not taken."""
    outcome = new()
    outcome.set_exception(fault)
    return outcome


def over_before() -> Outcome:
    """The outcome of what was over before it came."""
    outcome = new()
    outcome.cancel()
    return outcome
