"""The truth of a simulated mount, taken again and again while a test goes on.

Of all that ``truth_of`` tells two things are asked for most, at every tenth of a second: these are here by themselves,
for a tenth of its price.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable

from gateway.astro.spherical import hour_angle_to_horizon
from gateway.protocols.mechanics.simulated import Simulated
from gateway.protocols.mechanics.truth import EVERY, Truth, sample


def moving(simulator: Simulated) -> bool:
    """Whether a motor turns for anything but tracking."""
    simulator.come_to_now()
    return simulator.mechanics.moving(simulator.now)


def altitude(simulator: Simulated) -> float:
    """How high the tube really points, degrees."""
    ra, dec = simulator.truth()
    ground = simulator.mechanics.ground
    return hour_angle_to_horizon(ground.sidereal(simulator.now) - ra, dec, ground.latitude)[1]


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
