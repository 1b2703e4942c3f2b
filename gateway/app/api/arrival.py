"""Waits for the end of a motion towards a goal, in this program's gateway or in one that runs already."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from gateway.app.status import StatusLine
from gateway.core.errors import NoAnswer

#: Seconds without an answer of the mount after which its motion is not waited for any longer.
LOST = 10.0


async def until_over(
    under_way: Callable[[], Awaitable[bool]], look: Callable[[], Awaitable[StatusLine]], seconds: float, pause: float
) -> None:
    """Wait until nothing is under way, with a ``pause`` of so many seconds between two questions.

    Raises TimeoutError after ``seconds``, and NoAnswer if the mount has not answered for ``LOST`` seconds.
    """
    now = asyncio.get_running_loop().time
    heard, gone = now(), ""
    try:
        async with asyncio.timeout(seconds):
            while await under_way():
                line = await look()
                if line.online:
                    heard, gone = now(), ""
                else:
                    gone = line.reason or "the mount does not answer"
                if now() - heard > LOST:
                    raise NoAnswer(f"It is not known whether the motion goes on: {gone}.")
                await asyncio.sleep(pause)
    except TimeoutError:
        ending = f", and it is not known whether it goes on: {gone}." if gone else "; it goes on."
        raise TimeoutError(f"The motion has not ended within {seconds:g} s{ending}") from None
