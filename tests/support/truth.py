"""The true state of a simulated mount, sampled repeatedly during a test.

Tests ask for two parts of ``truth_of`` every tenth of a second. They have functions of their own here, which cost a
tenth as much.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from gateway.astro.spherical import hour_angle_to_horizon
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.mechanics.truth import SAMPLE_PERIOD, Truth, sample


def moving(simulator: Simulated) -> bool:
    """Whether a motor turns for anything but tracking."""
    simulator.advance_to_now()
    return simulator.mechanics.is_moving(simulator.now)


def altitude(simulator: Simulated) -> float:
    """Return the altitude at which the tube really points, degrees."""
    ra, dec = simulator.true_position()
    ground = simulator.mechanics.true_sky
    return hour_angle_to_horizon(ground.lst(simulator.now) - ra, dec, ground.latitude)[1]


@contextlib.asynccontextmanager
async def sampled(
    simulator: Simulated, keep: Callable[[Truth], object], every: float = SAMPLE_PERIOD
) -> AsyncIterator[None]:
    """Pass samples of the truth to ``keep`` while a ``with`` block lasts; raise what ``keep`` raised at its end.

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
