"""A written altitude limit is kept by every source of site and time, also by arrows."""

from __future__ import annotations

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.instrument.attacks import LOW, LOWEST, Attack, anywhere, arrow, assault, goes
from tests.support.instrument.worlds import HOUR, Slip, World, altitude_at

EVENING = 1768514400.0
#: By the wrong clock, or by the right one, the tube is up to 11 degrees lower in the west than by the mount's.
SLIPS = {"mount": Slip(told=-HOUR), "computer": Slip(computer=HOUR)}


@pytest.mark.parametrize("wrong", SLIPS)
@pytest.mark.parametrize("kind", ["cge", "onstep", "autostar", "alpaca polar"])
@pytest.mark.safety_line(3)
async def test_arrow_keeps_a_configured_limit_by_every_clock(kind: str, wrong: str) -> None:
    async with World(kind, (45.0, 10.0), EVENING, SLIPS[wrong], {"lowest": 20.0}) as world:
        assert await goes(world, 255.0, 45.0)
        for letter in "wsss":
            await arrow(world, letter, 6.0, "RM" if letter == "w" else "RS")
            there = world.mechanics.true_position(world.now)
            heights = [altitude_at(world.site, *there, world.now + ahead) for ahead in (0.0, world.slip.computer)]
            assert min(heights) > 20.0 - LOW
        assert min(heights) < 30.0


@pytest.mark.parametrize("kind", ["cge", "teenastro", "lx200gps polar"])
@pytest.mark.safety_line(3)
def test_goto_path_keeps_a_configured_limit_by_every_clock(kind: str) -> None:
    """The mount's clock is an hour fast, so its way is not as high as it seems."""
    slip = Slip(told=HOUR)
    for seed in range(3):
        result = run(assault(Attack("anywhere", (kind,), (anywhere,), limits=LOWEST, slip=slip), kind, seed))
        assert not result.through, result
