"""NexStar rates over a Meade: what the axes of the simulated telescope turn at, and what is put back afterwards.

Bytes are typed from Celestron's paper: P 3, motor 16 or 17, 6 or 7 for the sense, four times the arcseconds a second in
two bytes; P 2, motor, 24 or 25 hex, the key.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.protocols.mechanics.truth import truth_of
from tests.support.cable import lose_commands
from tests.support.in_process_gateway import Bridge

SIDEREAL = 15.041067
#: Arcseconds a second asked for, and what each family turns its motor in right ascension at while it tracks.
WEST = [
    # asked, lx200gps, autostar, lx200 (drives at 56.4 to 60.1 hertz: 14.1 to 15.03)
    (15.0, 15.0, 15.0, 15.0),
    (14.5, 14.5, 14.5, 14.5),
    (14.7, 14.7, 14.7, 14.7),
    (7.5, 7.5, 7.5, 14.1),
    (0.5, 0.5, 0.5, 14.1),
    (22.5, 22.5, 22.5, 29.14),
    (-3.0, -3.0, -3.0, -0.94),
    (30.0, 30.0, 30.0, 30.0),
    (150.0, 240.66, 240.66, 240.66),
    (-300.0, -360.0, -240.66, -240.66),
    (3600.0, 3600.0, 7200.0, 7200.0),
    (14400.0, 14400.0, 14400.0, 14400.0),
]
MODELS = ["lx200gps", "autostar", "lx200"]
#: Of the declination motor, which rests.
NORTH = [
    (7.5, 7.5, SIDEREAL, SIDEREAL),
    (-1.0, -1.0, -SIDEREAL, -SIDEREAL),
    (15.0, 15.0, SIDEREAL, SIDEREAL),
    (300.0, 360.0, 240.66, 240.66),
    (1800.0, 1800.0, 7200.0, 7200.0),
    (10800.0, 10800.0, 10800.0, 10800.0),
]
#: Keys 1 to 9 of a CGE: 0.5, 1, 4, 8, 16 and 64 times sidereal, then 1, 3 and 5 degrees.
KEYS = [
    (1, 7.5, SIDEREAL, SIDEREAL),
    (2, 15.0, SIDEREAL, SIDEREAL),
    (4, 240.66, 240.66, 240.66),
    (5, 240.66, 240.66, 240.66),
    (6, 1080.0, 240.66, 240.66),
    (7, 3600.0, 7200.0, 7200.0),
    (8, 10800.0, 10800.0, 10800.0),
    (9, 18000.0, 18000.0, 18000.0),
]


def meade(model: str, polar: bool = True, **config: Any) -> Bridge:
    bridge = Bridge(
        model,
        driven="lx200",
        presented="nexstar",
        surface="cge",
        latency=0.02,
        config={"sun": 0.0, "lowest": -90.0, **config},
    )
    if polar:
        bridge.sim.feed(b":AP#:CM#")
    return bridge


def variable(device: int, arcseconds: float) -> bytes:
    quarters = round(abs(arcseconds) * 4)
    return bytes((80, 3, device, 6 if arcseconds > 0 else 7, quarters // 256, quarters % 256, 0, 0))


def key(device: int, number: int) -> bytes:
    return bytes((80, 2, device, 36, number, 0, 0, 0))


async def turns(bridge: Any, device: int, frame: bytes) -> float:
    """Arcseconds a second of the axis a moment later; then it is let go."""
    client = bridge.client()
    assert await client.ask(frame) == b"#"
    await asyncio.sleep(2.0)
    seen = truth_of(bridge.sim)
    assert await client.ask(key(device, 0)) == b"#"
    await asyncio.sleep(3.0)
    after = truth_of(bridge.sim)
    assert (after.rate1 * 3600.0, after.rate2 * 3600.0) == pytest.approx((SIDEREAL, 0.0), abs=0.01)
    assert after.tracking and not after.moving
    return (seen.rate1 if device == 16 else seen.rate2) * 3600.0


@pytest.mark.parametrize("model", MODELS)
async def test_each_nexstar_motion_rate_uses_the_nearest_rate_of_the_meade(model: str) -> None:
    column = 1 + MODELS.index(model)
    async with meade(model) as bridge:
        for row in WEST:
            assert await turns(bridge, 16, variable(16, row[0])) == pytest.approx(row[column], rel=0.007), row
        for row in NORTH:
            assert await turns(bridge, 17, variable(17, row[0])) == pytest.approx(row[column], rel=0.005), row
        for row in KEYS:
            assert await turns(bridge, 17, key(17, row[0])) == pytest.approx(row[column], rel=0.005), row
        assert await bridge.client().ask(b"t") == b"\x02#"


@pytest.mark.parametrize("model", MODELS)
async def test_meade_settings_changed_for_a_motion_are_restored(model: str) -> None:
    async with meade(model) as bridge:
        for frame in (variable(17, 3.0), variable(16, 14.5), variable(17, 10800.0), variable(16, 360.0)):
            await turns(bridge, frame[2], frame)
        kept = bridge.sim.stored_values
        assert float(kept.get("Rg", 15.0)) == 15.0
        assert bridge.sim.mechanics.max_rate == 8.0
        assert [float(kept.get(name) or 8.0) for name in ("RA", "RE")] == [8.0, 8.0]
        assert 60.0 <= kept.get("hertz", 60.1) <= 60.1


@pytest.mark.parametrize("model", MODELS)
async def test_stop_restores_the_meade_drive_rate(model: str) -> None:
    async with meade(model) as bridge:
        client = bridge.client()
        await client.ask(variable(16, 14.5))
        await asyncio.sleep(2.0)
        await bridge.controller.stop()
        await asyncio.sleep(3.0)
        assert truth_of(bridge.sim).rate1 * 3600.0 == pytest.approx(SIDEREAL, abs=0.001)


async def test_meade_drive_rate_set_by_a_program_returns_after_a_motion() -> None:
    """FF FD is the lunar rate."""
    async with meade("autostar") as bridge:
        client = bridge.client()
        assert await client.ask(bytes((80, 3, 16, 6, 255, 253, 0, 0))) == b"#"
        assert await client.ask(variable(16, 7.5)) == b"#"
        await asyncio.sleep(3.0)
        assert truth_of(bridge.sim).rate1 * 3600.0 == pytest.approx(7.5, abs=0.01)
        assert await client.ask(key(16, 0)) == b"#"
        await asyncio.sleep(3.0)
        assert truth_of(bridge.sim).rate1 * 3600.0 == pytest.approx(14.685, abs=0.001)


@pytest.mark.parametrize(
    ("hand_control", "hertz", "arcseconds"), [(b":TL#", 57.9, 14.685), (b":TM#:ST059.4#", 59.4, 14.85)]
)
async def test_meade_drive_rate_set_at_the_hand_control_returns_after_a_motion(
    hand_control: bytes, hertz: float, arcseconds: float
) -> None:
    """It is displayed, so it can be read before a motion replaces it; also if a program has set another one before."""
    async with meade("autostar") as bridge:
        client = bridge.client()
        for asked in (variable(16, 15.041), bytes((80, 3, 16, 6, 255, 255, 0, 0))):  # FF FF is sidereal
            assert await client.ask(asked) == b"#"
            await asyncio.sleep(2.0)
            assert await client.ask(key(16, 0)) == b"#"
            await asyncio.sleep(70.0)
            bridge.sim.feed(hand_control)
            for _ in range(2):
                assert await client.ask(variable(16, 7.5)) == b"#"
                await asyncio.sleep(3.0)
                assert truth_of(bridge.sim).rate1 * 3600.0 == pytest.approx(7.5, abs=0.01)
                assert await client.ask(key(16, 0)) == b"#"
                await asyncio.sleep(3.0)
                assert bridge.sim.stored_values["hertz"] == hertz
                assert truth_of(bridge.sim).rate1 * 3600.0 == pytest.approx(arcseconds, abs=0.01)


async def test_meade_drive_rate_set_at_the_hand_control_survives_an_arrow_and_a_stop() -> None:
    async with meade("autostar") as bridge:
        client = bridge.client()
        bridge.sim.feed(b":TL#")
        for stop in (key(16, 0), b"M"):
            assert await client.ask(key(16, 5)) == b"#"
            await asyncio.sleep(2.0)
            assert await client.ask(stop) == b"#"
            await asyncio.sleep(3.0)
            assert bridge.sim.stored_values["hertz"] == 57.9


async def test_lunar_rate_lost_on_the_line_is_sent_again() -> None:
    async with meade("autostar") as bridge:
        lost = lose_commands(bridge, (b":TL#",))
        await bridge.controller.perform(op.TrackRate(name="lunar"))
        assert lost == [b":TL#"]
        assert bridge.sim.stored_values["hertz"] == 57.9


async def test_unreadable_hand_control_rate_is_reported_once() -> None:
    async with meade("lx200gps") as bridge:
        for _ in range(2):
            await turns(bridge, 17, variable(17, 10800.0))
        [said] = [one.text for one in bridge.wire_log.recent_notices if "does not report" in one.text]
        assert "8 degrees a second" in said


@pytest.mark.parametrize("model", ["lx200gps", "autostar"])
async def test_approximated_meade_key_rate_is_reported_once(model: str) -> None:
    """4 and 5 are one speed here."""
    async with meade(model) as bridge:
        for number in (4, 5, 4, 9, 9):
            await turns(bridge, 17, key(17, number))
        said = [one.text for one in bridge.wire_log.recent_notices if "no nearer speed" in one.text]
        assert len(said) == len(set(said)) >= 1 and "120.33" in said[0]


async def test_approximated_meade_rate_is_logged_once() -> None:
    async with meade("lx200") as bridge:
        for _ in range(2):
            await turns(bridge, 17, variable(17, 3600.0))
        said = [entry.note for entry in bridge.entries if "this mount has no nearer speed" in entry.note]
        assert len(said) == 1 and "3600" in said[0] and "7200" in said[0]
        await turns(bridge, 17, variable(17, 7200.0))
        assert sum("no nearer speed" in entry.note for entry in bridge.entries) == 1


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("percent", "config", "arcseconds"), [(20, {}, 7.52), (50, {}, 18.8), (100, {}, 37.6)])
async def test_meade_guide_pulse_runs_at_the_guide_rate_for_its_time(
    model: str, percent: int, config: dict[str, float], arcseconds: float
) -> None:
    """2.5 s at so many percent of sidereal; where the telescope guides at its one rate alone, for as much shorter.

    One that the gateway has to end itself takes up to 0.05 s more until it is heard, 0.8 arcseconds.
    """
    async with meade(model, **config) as bridge:
        before = truth_of(bridge.sim).axis2
        assert await bridge.client().ask(bytes((80, 3, 17, 38, percent, 250, 0, 0))) == b"#"
        await asyncio.sleep(6.0)
        assert (truth_of(bridge.sim).axis2 - before) * 3600.0 == pytest.approx(arcseconds, rel=0.04, abs=0.8)


@pytest.mark.parametrize(
    ("model", "ms", "arcseconds"), [*((model, 2000, 15.04) for model in MODELS), ("autostar", 50000, 376.0)]
)
async def test_configured_guide_rate_applies_to_a_meade(model: str, ms: int, arcseconds: float) -> None:
    """``:Mg`` of an LX200 program at half of sidereal, whatever the telescope guides at. A pulse of 50 s is made of
    three pieces of 9.999 s and less at the telescope's one rate.
    """
    config = {"sun": 0.0, "lowest": -90.0, "guide_rate": 0.5}
    bridge = Bridge(model, driven="lx200", presented="lx200", surface="lx200gps", latency=0.02, config=config)
    bridge.sim.feed(b":AP#:CM#")
    async with bridge:
        before = truth_of(bridge.sim).axis2
        bridge.client().send(b":Mgn%d#" % ms)
        await asyncio.sleep(ms / 1000.0 + 10.0)
        moved = (truth_of(bridge.sim).axis2 - before) * 3600.0
        assert moved == pytest.approx(arcseconds, rel=0.02, abs=0.8)


@pytest.mark.parametrize(("asked", "speed"), [(b"", 8.0), (b":Sw2#", 2.0), (b":Sw5#", 5.0)])
@pytest.mark.parametrize("order", [b":Sr03:30:00#:Sd+20*00:00#:MS#", b":Sz120*00#:Sa+45*00#:MA#"])
async def test_meade_goto_runs_at_the_fastest_rate_of_its_program(asked: bytes, speed: float, order: bytes) -> None:
    """Meade: ``:SwN#``, set maximum slew rate to N degrees per second. Other programs' gotos go as before."""
    async with Bridge("lx200gps", driven="lx200", presented="lx200", config={"sun": 0.0, "lowest": -90.0}) as bridge:
        client = bridge.client()
        if asked:
            assert await client.ask(asked, ending=b"1") == b"1"
        await client.ask(order, ending=b"110")
        fastest = 0.0
        for _ in range(40):
            await asyncio.sleep(0.25)
            seen = truth_of(bridge.sim)
            fastest = max(fastest, abs(seen.rate1), abs(seen.rate2))
        assert fastest == pytest.approx(speed, rel=0.02)
        await asyncio.sleep(60)
        assert bridge.sim.stored_values.get("Sw", 8) == 8
