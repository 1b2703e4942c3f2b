"""A telescope that tells nothing while it seeks its home does not seek it while the Sun is up."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import NearSun
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import EVENING, Bridge

#: 2026-01-15 11:20 UTC: the Sun is near the meridian at 10 E.
NOON = EVENING - 38400.0


@pytest.mark.parametrize("start", [EVENING, NOON])
@pytest.mark.parametrize("sun", [0.0, 20.0])
@pytest.mark.safety_line(4)
def test_a_meade_seeks_its_home_only_while_the_sun_is_down(start: float, sun: float) -> None:
    async def program() -> None:
        async with Bridge("lx200gps", driven="lx200", start=start, config={"sun": sun}) as bridge:
            if start == NOON and sun:
                with pytest.raises(NearSun, match="hand control"):
                    await bridge.controller.perform(op.Home())
            else:
                await bridge.controller.perform(op.Home())
                await asyncio.sleep(5.0)
            assert (b":hF#" in bridge.sent()) is not (start == NOON and sun > 0.0)

    run(program())
