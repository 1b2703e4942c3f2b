"""A telescope that tells nothing while it seeks its home does not seek it while the Sun is up."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core import operations as op
from gateway.core.errors import NearSun
from tests.support.in_process_gateway import EVENING, Bridge

#: 2026-01-15 11:20 UTC: the Sun is near the meridian at 10 E.
NOON = EVENING - 38400.0


@pytest.mark.parametrize("start", [EVENING, NOON])
@pytest.mark.parametrize("sun", [0.0, 20.0])
@pytest.mark.parametrize(("seek", "command"), [(op.Home(), b":hF#"), (op.SetHome(), b":hS#")])
@pytest.mark.safety_line(4)
async def test_meade_seeks_home_only_while_the_sun_is_down(
    start: float, sun: float, seek: op.Operation, command: bytes
) -> None:
    """Also where it only stores what it finds: the paper says of :hS#, too, that it seeks."""
    async with Bridge("lx200gps", driven="lx200", start=start, config={"sun": sun}) as bridge:
        if start == NOON and sun:
            with pytest.raises(NearSun, match="hand control"):
                await bridge.controller.perform(seek)
        else:
            await bridge.controller.perform(seek)
            await asyncio.sleep(5.0)
        assert (command in bridge.sent_requests()) is not (start == NOON and sun > 0.0)
