"""The truth of a simulated mount, taken again and again while a test goes on."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.mechanics.truth import EVERY, Truth, sample


@contextlib.asynccontextmanager
async def sampled(simulator: Simulated, keep: Callable[[Truth], object], every: float = EVERY) -> AsyncIterator[None]:
    """Hand ``keep`` the truth for as long as a ``with`` block lasts; what ``keep`` raised is raised at its end.

    ``keep`` is the ``append`` of a list, or a function that asserts.
    """
    sampler = asyncio.get_running_loop().create_task(sample(simulator, keep, every))
    try:
        yield
    finally:
        if not sampler.done():
            sampler.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await sampler
