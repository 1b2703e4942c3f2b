"""Guide pulses and slow arrows move the tube on the sky, in right ascension and declination, by its true position."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from tests.support.in_process_gateway import Bridge

OPEN = {"lowest": -90.0, "sun": 0.0}
NORTH, SOUTH = (45.0, 10.0), (-33.0, 150.0)
#: Degrees a second of a guide pulse at the full sidereal rate.
SIDEREAL = 15.041


async def pointed(bridge: Bridge, azimuth: float, altitude: float) -> None:
    hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, bridge.sim.mechanics.sky.latitude)
    await bridge.controller.perform(op.Goto((bridge.sim.mechanics.sky.lst(bridge.clock()) - hour_angle) % 360.0, dec))
    await asyncio.sleep(60.0)


async def moved(bridge: Bridge, order: Any) -> tuple[float, float]:
    """Return how far the tube has moved west and north against the stars, arcseconds."""
    before = bridge.sim.true_position()
    await order
    await asyncio.sleep(6.0)
    after = bridge.sim.true_position()
    return wrap180(before[0] - after[0]) * 3600.0, (after[1] - before[1]) * 3600.0


@pytest.mark.parametrize(("driven", "model"), [("lx200", "lx200gps"), ("lx200", "autostar"), ("nexstar", "cpc")])
@pytest.mark.parametrize(
    ("site", "azimuth", "altitude"), [(NORTH, 310.0, 50.0), (NORTH, 100.0, 35.0), (SOUTH, 40.0, 50.0)]
)
async def test_guide_pulses_move_the_tube_in_sky_directions(
    driven: str, model: str, site: tuple[float, float], azimuth: float, altitude: float
) -> None:
    async with Bridge(model, driven=driven, site=site, config=OPEN, latency=0.01, ramps=False) as bridge:
        await pointed(bridge, azimuth, altitude)
        await bridge.controller.answer(op.HorizontalPosition())
        rate = bridge.driver.abilities(False).guides[0] * SIDEREAL
        for direction, west, north in (("n", 0, 1), ("s", 0, -1), ("w", 1, 0), ("e", -1, 0)):
            order = bridge.controller.perform(op.Pulse(op.Direction(direction), 2000, sky=True))
            found = await moved(bridge, order)
            assert found == pytest.approx((west * rate * 2.0, north * rate * 2.0), abs=0.1 * rate * 2.0), direction

        async def both() -> None:
            await bridge.controller.perform(op.Pulse(op.Direction.NORTH, 2000, sky=True))
            await bridge.controller.perform(op.Pulse(op.Direction.EAST, 1000, sky=True))

        if driven == "lx200":
            assert await moved(bridge, both()) == pytest.approx((-rate, rate * 2.0), abs=0.1 * rate * 2.0)


#: A slow arrow: what a program sends, and how fast it is to go against the stars, arcseconds a second west and north.
SLOW = {
    b":RG#:Mw#": (15.04, 0.0),
    b":RG#:Me#": (-15.04, 0.0),
    b":RG#:Mn#": (0.0, 15.04),
    b":RG#:Ms#": (0.0, -15.04),
    b"P\x02\x10\x24\x01\0\0\0": (7.52, 0.0),
    b"P\x02\x10\x25\x01\0\0\0": (-7.52, 0.0),
    b"P\x02\x10\x24\x02\0\0\0": (15.04, 0.0),
    b"P\x02\x10\x25\x02\0\0\0": (-15.04, 0.0),
    b"P\x03\x10\x06\0\xb4\0\0": (45.0 - 15.04, 0.0),  # a variable rate is that of the motor
}
ENDS = {b":": b":Qw#:Qe#:Qn#:Qs#", b"P": b"P\x02\x10\x24\0\0\0\0"}


@pytest.mark.parametrize("adds", [False, True], ids=["replaces", "adds"])
@pytest.mark.parametrize("order", SLOW)
@pytest.mark.parametrize(("model", "site"), [("german", NORTH), ("german", SOUTH), ("polar", NORTH)])
async def test_slow_arrows_move_an_alpaca_mount_in_sky_directions(
    model: str, site: tuple[float, float], order: bytes, adds: bool
) -> None:
    """Servers disagree whether MoveAxis includes tracking. The polar one has a few fixed rates, and guide pulses."""
    bridge = Bridge(
        model, driven="alpaca", presented="lx200" if order[:1] == b":" else "nexstar",
        surface="lx200gps" if order[:1] == b":" else "cge", site=site, config=OPEN, latency=0.01, ramps=False,
        simulated={"adds_tracking": adds},
    )  # fmt: skip
    async with bridge:
        await pointed(bridge, 150.0 if site is NORTH else 20.0, 50.0)
        client = bridge.client()
        client.send(order)
        await asyncio.sleep(1.5)
        before = bridge.sim.true_position()
        await asyncio.sleep(4.0)
        after = bridge.sim.true_position()
        client.send(ENDS[order[:1]])
        await asyncio.sleep(4.0)
        west, north = SLOW[order]
        if site is SOUTH and order[:1] == b"P":  # the motor's sense: positive is east there
            west = -west if order[1] == 2 else -45.0 - 15.04
        if model == "polar":  # by guide pulses, at their own rate, and at the one variable rate near it
            west = 0.0 if west == 45.0 - 15.04 else max(-7.52, min(7.52, west))
            north = max(-7.52, min(7.52, north))
        found = wrap180(before[0] - after[0]) * 900.0, (after[1] - before[1]) * 900.0
        assert found == pytest.approx((west, north), abs=max(1.5, 0.1 * abs(west or north)))
        before = bridge.sim.true_position()
        await asyncio.sleep(10.0)
        assert bridge.sim.tracking and moved_by(before, bridge.sim.true_position()) < 0.05


def moved_by(one: tuple[float, float], other: tuple[float, float]) -> float:
    return separation(*one, *other) * 3600.0


@pytest.mark.parametrize("adds", [False, True], ids=["replaces", "adds"])
@pytest.mark.parametrize(
    ("order", "az", "alt"), [(b":Mw#", 1, 0), (b":Me#", -1, 0), (b":Mn#", 0, 1), (b":Mw#:Mn#", 1, 1)]
)
async def test_slow_arrows_add_to_tracking_on_an_alt_az_alpaca_mount(
    order: bytes, az: int, alt: int, adds: bool
) -> None:
    bridge = Bridge(
        "altaz", driven="alpaca", surface="lx200gps", config=OPEN, latency=0.01, ramps=False,
        simulated={"adds_tracking": adds},
    )  # fmt: skip
    async with bridge:
        await pointed(bridge, 120.0, 50.0)
        star, began = bridge.sim.true_position(), bridge.clock()
        client = bridge.client()
        client.send(b":RG#" + order)
        await asyncio.sleep(4.0)
        client.send(order.replace(b"M", b"Q"))
        await asyncio.sleep(4.0)
        here, there = bridge.sim.true_position(), star
        latitude, sidereal = NORTH[0], bridge.sim.mechanics.sky.lst(bridge.clock())
        now = hour_angle_to_horizon(wrap180(sidereal - here[0]), here[1], latitude)
        would = hour_angle_to_horizon(wrap180(sidereal - there[0]), there[1], latitude)
        found = wrap180(now[0] - would[0]) * 900.0, (now[1] - would[1]) * 900.0
        assert found == pytest.approx((15.04 * az, 15.04 * alt), abs=2.0), bridge.clock() - began
        assert bridge.sim.tracking
        await asyncio.sleep(60.0)
        assert moved_by(here, bridge.sim.true_position()) < 1.0


@pytest.mark.parametrize("question", [b"L", b":D#"])
async def test_motion_by_hand_is_not_reported_as_a_goto(question: bytes) -> None:
    nexstar = question == b"L"
    bridge = Bridge(
        "german", driven="alpaca", presented="nexstar" if nexstar else "lx200",
        surface="cge" if nexstar else "lx200gps", config=OPEN,
    )  # fmt: skip
    async with bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        client.send(b"P\x02\x10\x24\x09\0\0\0" if nexstar else b":RS#:Mw#")
        for number in range(40):
            if number == 20:
                client.send(b"P\x02\x10\x24\0\0\0\0" if nexstar else b":Qw#")
            assert await other.ask(question) == (b"0#" if nexstar else b"#"), number
            await asyncio.sleep(0.1)


async def test_sky_pulse_is_refused_where_it_would_turn_one_motor() -> None:
    bridge = Bridge("lx200", driven="lx200", config=OPEN)
    bridge.sim.feed(b":AA#")
    bridge.sim.aligned = True
    async with bridge:
        await bridge.controller.answer(op.GetStatus())
        with pytest.raises(Unsupported, match="latitude"):
            await bridge.controller.perform(op.Pulse(op.Direction.NORTH, 2000, sky=True))
        assert not [data for data in bridge.sent_requests() if data[:2] == b":M"]
