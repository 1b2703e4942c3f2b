"""What is guided goes as fast as was asked, on motors old and new: measured at the axes of the simulated mount.

The bytes are typed from Celestron's paper: a variable rate is four times the arcseconds a second in two bytes, 6 is the
positive sense of a motor, FF FF the sidereal rate.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import truth_of
from tests.support.in_process_gateway import Bridge

#: Keys 1 and 2 are half and once sidereal on a CGE, twice and four times on a NexStar GPS and on an AVX.
MOUNTS = [
    ("cge", "4.21", b""),
    ("cge", "3.02", b""),
    ("avx", "5.31", b""),
    ("nexstar-gps", "4.21", b"T\2"),
    ("nexstar-gps", "2.2", b"T\2"),
]
RATES = [3.0, 7.5, 15.0]


def mount(model: str, version: str, first: bytes = b"", **config: Any) -> Bridge:
    limits = {"sun": 0.0, "lowest": -90.0, **({"mode": "eq-north"} if version == "2.2" else {}), **config}
    bridge = Bridge(model, version, surface="lx200gps", config=limits)
    if first:
        bridge.sim.feed(first)
    return bridge


def axes(bridge: Any) -> tuple[float, float, float]:
    seen = truth_of(bridge.sim)
    return seen.axis1, seen.axis2, bridge.clock()


def moved(before: tuple[float, float, float], after: tuple[float, float, float]) -> tuple[float, float]:
    """Arcseconds beyond what tracking turns the first axis."""
    tracked = SIDEREAL_RATE * (after[2] - before[2])
    return (wrap180(after[0] - before[0]) - tracked) * 3600.0, wrap180(after[1] - before[1]) * 3600.0


@pytest.mark.parametrize(("model", "version", "first"), MOUNTS, ids=lambda part: part if isinstance(part, str) else "")
@pytest.mark.parametrize("rate", RATES)
async def test_guide_pulses_and_arrows_run_at_the_guide_rate(
    model: str, version: str, first: bytes, rate: float
) -> None:
    async with mount(model, version, first) as bridge:
        client = bridge.client()
        client.send(b":Rg%04.1f#" % rate)
        for direction, axis in ((b"w", 0), (b"e", 0), (b"n", 1), (b"s", 1)):
            await asyncio.sleep(2.0)
            start = axes(bridge)
            client.send(b":Mg%s2000#" % direction)
            await asyncio.sleep(4.0)
            along = moved(start, axes(bridge))
            assert abs(along[axis]) == pytest.approx(rate * 2.0, rel=0.06), direction  # and what an answer takes
            assert abs(along[1 - axis]) < 0.1
            client.send(b":RG#:M%s#" % direction)
            await asyncio.sleep(1.0)
            start = axes(bridge)
            await asyncio.sleep(4.0)
            assert abs(moved(start, axes(bridge))[axis]) == pytest.approx(rate * 4.0, rel=0.06), direction
            client.send(b":Q%s#" % direction)
            await asyncio.sleep(1.0)
            start = axes(bridge)
            await asyncio.sleep(4.0)
            assert moved(start, axes(bridge)) == pytest.approx((0.0, 0.0), abs=0.05)


def sent_for(commands: bytes, *, model: str = "cge", version: str = "4.21", **config: Any) -> list[bytes]:
    async def program() -> list[bytes]:
        async with mount(model, version, **config) as bridge:
            before = len(bridge.sent_requests())
            client = bridge.client()
            for command in commands.split(b" "):
                client.send(command)
                await asyncio.sleep(2.0)
            return [one for one in bridge.sent_requests()[before:] if one[:1] == b"P"]

    found: list[list[bytes]] = []

    async def keep() -> None:
        found.append(await program())

    run(keep())
    return found[0]


def test_guide_pulse_sends_the_sum_with_tracking_and_then_the_sidereal_rate() -> None:
    """0.25 of sidereal west: 15.04 and 3.76 are 18.80 arcseconds a second, 75 quarters; east 11.28, 45 quarters."""
    west = sent_for(b":Mgw1000#", guide_rate=0.25)
    assert west == [bytes((80, 3, 16, 6, 0, 75, 0, 0)), bytes((80, 3, 16, 6, 255, 255, 0, 0))]
    east = sent_for(b":Mge1000#", guide_rate=0.25)
    assert east == [bytes((80, 3, 16, 6, 0, 45, 0, 0)), bytes((80, 3, 16, 6, 255, 255, 0, 0))]


def test_guide_rate_equal_to_a_key_rate_presses_that_key() -> None:
    assert sent_for(b":Mgw1000#") == [bytes((80, 2, 16, 36, 1, 0, 0, 0)), bytes((80, 2, 16, 36, 0, 0, 0, 0))]


def test_guide_pulse_adds_to_a_custom_drive_rate_and_restores_it() -> None:
    """The lunar rate, 14.685, and 0.25 of sidereal, 3.76, are 18.445: 74 quarters; FF FD is the lunar rate."""
    sent = sent_for(b":TL# :Mgw1000#", guide_rate=0.25)
    assert sent[-2:] == [bytes((80, 3, 16, 6, 0, 74, 0, 0)), bytes((80, 3, 16, 6, 255, 253, 0, 0))]


def test_guide_rate_of_zero_moves_nothing() -> None:
    assert all(one[3] == 0x46 for one in sent_for(b":Rg00.0# :Mgw1000#"))


async def test_stop_during_a_guide_pulse_restores_tracking() -> None:
    async with mount("nexstar-gps", "4.21", b"T\2") as bridge:
        client = bridge.client()
        client.send(b":Mgw9000#")
        await asyncio.sleep(2.0)
        client.send(b":Q#")
        await asyncio.sleep(2.0)
        start = axes(bridge)
        await asyncio.sleep(10.0)
        assert moved(start, axes(bridge)) == pytest.approx((0.0, 0.0), abs=0.05)
        assert bridge.sim.tracking


@pytest.mark.parametrize("ms", [15, 25, 333])
def test_short_guide_pulses_timed_by_the_motor_move_the_requested_amount(ms: int) -> None:
    """They count hundredths of a second: what is rounded up there is made up for in percent."""
    (sent,) = sent_for(b":Mgn%04d#" % ms, model="avx", version="5.31")
    percent, ticks = sent[4], sent[5]
    assert percent * ticks == pytest.approx(50 * ms / 10, rel=0.03)


@pytest.mark.parametrize(("model", "version"), [("gt", "101.0"), ("nexstar-gps", "1.2")])
@pytest.mark.parametrize(("rate", "degrees"), [(b":RG#", 7.52 / 3600.0), (b":RM#", 1.0), (b":RE02.0#", 2.0)])
async def test_arrow_made_of_small_gotos_averages_the_requested_rate(
    model: str, version: str, rate: bytes, degrees: float
) -> None:
    """Hand controls before 1.6 have no way to the motors, and tell and take steps of 20 arcseconds."""
    async with mount(model, version) as bridge:
        client = bridge.client()
        client.send(rate + b":Ms#")
        await asyncio.sleep(5.0)
        start = bridge.sim.true_position()[1]
        await asyncio.sleep(10.0)
        turned = start - bridge.sim.true_position()[1]
        assert turned == pytest.approx(10.0 * degrees, rel=0.08, abs=20.0 / 3600.0)
        client.send(b":Qs#")
