"""Work that goes on when whoever waits for it gives up: a stop that was asked for, an exchange that others wait for.

``asyncio.shield`` does the same, but from Python 3.14 on it reports what such work raises later to the event loop,
which writes it on the terminal of a user who can do nothing about it. Here it is told to those who still wait, and to
nobody else.
"""

from __future__ import annotations

import asyncio
from typing import Any, TypeVar

_T = TypeVar("_T")
Outcome = asyncio.Future[Any]


async def result_of(work: asyncio.Future[_T]) -> _T:
    """Wait for work -> its result; who gives up ends it for nobody. Raises what the work raises, or CancelledError."""
    if not work.done():
        try:
            await asyncio.wait((work,))
        except asyncio.CancelledError:
            work.add_done_callback(heed)
            raise
    return work.result()


def heed(outcome: asyncio.Future[_T]) -> None:
    """Mark the exception as retrieved, so that asyncio does not log one for which nobody waits."""
    if not outcome.cancelled():
        outcome.exception()


def outcome() -> Outcome:
    """What whoever asks for something waits for: one that is not wanted any more is cancelled."""
    work: Outcome = asyncio.get_running_loop().create_future()
    work.add_done_callback(heed)
    return work


def done() -> Outcome:
    """That of what needs nothing to be done."""
    work = outcome()
    work.set_result(None)
    return work


def refused(fault: Exception) -> Outcome:
    """That of what is not taken."""
    work = outcome()
    work.set_exception(fault)
    return work


def over_before() -> Outcome:
    """That of what was over before it came."""
    work = outcome()
    work.cancel()
    return work
