"""Only a simulated mount can be in a hurry: limits and plausibility of a real one go by its real speed."""

from __future__ import annotations

import asyncio

import pytest

from gateway.app.bindings import make_transport
from gateway.app.config import MountConfig
from gateway.app.gateway import Gateway
from gateway.mount.link.line import MountLink


@pytest.mark.parametrize(("at", "hurry"), [("nexstar@sim", 10.0), ("nexstar@/dev/ttyUSB9", 1.0)])
def test_speed_is_that_of_a_simulated_mount(at: str, hurry: float) -> None:
    async def program() -> None:
        gateway = Gateway(MountConfig(at=at, speed=10.0), [])
        gateway.prepare(
            lambda rules, transcript: MountLink(make_transport(gateway.mount, gateway.config, None), rules, transcript)
        )
        assert gateway.controller.driver.speed_factor == hurry

    asyncio.run(program())
