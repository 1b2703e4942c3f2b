"""Only a simulated mount can be in a hurry: limits and plausibility of a real one go by its real speed.

A simulated mount may run in another process; nobody simulates one at the other end of a serial cable.
"""

from __future__ import annotations

import pytest

from gateway.app.bindings import make_transport
from gateway.app.config import MountConfig
from gateway.app.gateway import Gateway
from gateway.mount.link.line import MountLink


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("at", "hurry", "told"),
    [
        ("nexstar@sim", 10.0, 0),
        ("nexstar@socket://127.0.0.1:9", 10.0, 1),
        ("nexstar@rfc2217://127.0.0.1:9", 10.0, 1),
        ("nexstar@/dev/ttyUSB9", 1.0, 0),
    ],
)
async def test_simulation_speed_is_ignored_with_a_warning_on_a_real_mount(at: str, hurry: float, told: int) -> None:
    warnings: list[str] = []
    gateway = Gateway(MountConfig(at=at, speed=10.0), [], warn=warnings.append)
    gateway.prepare(
        lambda rules, transcript: MountLink(make_transport(gateway.mount, gateway.config, None), rules, transcript)
    )
    assert gateway.controller.driver.speed_factor == hurry
    assert [("speed = 10" in warning, "leave it out" in warning) for warning in warnings] == [(True, True)] * told
