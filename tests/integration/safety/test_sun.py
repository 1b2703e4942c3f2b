"""The Sun: gotos to it and past it are refused with words, and whatever moves towards it is stopped.

At the June solstice it stands at 6h, +23 26' (by the almanac), at the March equinox at 0h, 0 deg. The simulated fork
begins at the meridian, 45 degrees high.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.core import operations as op
from gateway.core.errors import NearSun
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import EVENING, Bridge

#: 2026-06-21 10:00 UTC at 45 N, 10 E: the Sun at azimuth 136, altitude 63.
JUNE = 1782036000.0
#: 2026-03-20 11:27 UTC: the Sun at the meridian, 45 degrees high.
MARCH = 1774006020.0
SKY = Sky()

TO_IT = b":Sr06:00:00#:Sd+23*26:00#:MS#"
PAST_IT = b":Sr06:36:00#:Sd+45*00:00#:MS#"  # azimuth 80, altitude 69: 22 degrees from it, on its other side
NEAR_IT = b":Sr06:00:00#:Sd+04*26:00#:MS#"  # 19 degrees
FAR_ENOUGH = b":Sr06:00:00#:Sd+02*26:00#:MS#"  # 21 degrees
NO = b"112Too close to the Sun.#"
NO_WAY = b"112The way there passes too close to the Sun.#"


def distance(bridge: Any) -> float:
    """How far the tube really is from the Sun, degrees."""
    now = bridge.clock()
    return separation(*bridge.sim.mechanics.true_position(now), *SKY.sun(now))


def notes(bridge: Any) -> str:
    return "\n".join(entry.note for entry in bridge.entries)


async def nearest(bridge: Any, seconds: float, done: Callable[[], bool] = lambda: False) -> float:
    """The least distance that the tube really had meanwhile."""
    least = distance(bridge)
    for _ in range(round(seconds * 20)):
        await asyncio.sleep(0.05)
        least = min(least, distance(bridge))
        if done():
            break
    return least


@pytest.mark.parametrize(
    ("start", "config", "asked", "reply"),
    [
        (JUNE, {}, TO_IT, NO),
        (JUNE, {}, NEAR_IT, NO),
        (JUNE, {}, FAR_ENOUGH, b"110"),
        (JUNE, {}, PAST_IT, NO_WAY),
        (JUNE, {"sun": 5.0}, NEAR_IT, b"110"),
        (JUNE, {"sun": 30.0}, FAR_ENOUGH, NO),
        (JUNE, {"sun": 0.0}, TO_IT, b"110"),
        (JUNE, {"sun": 0.0}, PAST_IT, b"110"),
        (JUNE + 43200.0, {"lowest": -90.0}, TO_IT, b"110"),  # it is down
        (JUNE, {}, b":Sa+63*00#:Sz136*00#:MA#", b"111"),
        (JUNE, {}, b":Sa+69*00#:Sz080*00#:MA#", b"111"),
        (JUNE, {}, b":Sa+63*00#:Sz250*00#:MA#", b"110"),
    ],
)
@pytest.mark.safety_line(4)
async def test_lx200_goto_near_the_sun_is_refused_on_a_fork(
    start: float, config: dict[str, Any], asked: bytes, reply: bytes
) -> None:
    async with Bridge("6-8se", start=start, config=config) as bridge:
        assert await bridge.client().ask(asked, ending=reply) == reply
        went = [sent for sent in bridge.sent_requests() if sent[:1] in b"rb"]
        assert bool(went) == (reply == b"110")


async def test_nexstar_goto_near_the_sun_reports_no_motion_and_logs_the_reason() -> None:
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se", start=JUNE) as bridge:
        client = bridge.client()
        assert await client.ask(b"r40000000,10AA0000") == b"#"  # 6h, +23.4
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"0#"
        assert "Goto: Too close to the Sun." in notes(bridge)
        assert b":MS#" not in bridge.sent_requests()
        assert await client.ask(b"b38E38E00,310F6C00") == b"#"  # azimuth 80, altitude 69
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"0#"
        assert "way there passes too close" in notes(bridge)
        assert await client.ask(b"r40000000,01BB0000") == b"#"  # 6h, +2.4
        await asyncio.sleep(1)
        assert await client.ask(b"L") == b"1#"


async def test_german_mount_is_judged_on_its_path_through_the_pole() -> None:
    async with Bridge("cge", start=JUNE) as bridge:
        client = bridge.client()
        east = b":Sr09:38:00#:Sd+23*00:00#:MS#"  # five hours before the meridian
        assert await client.ask(east, ending=b"110") == b"110"
        while await client.ask(b":D#") == b"\x7f#":
            await asyncio.sleep(1)
        before_meridian = b":Sr04:45:00#:Sd+00*00:00#:MS#"  # on the same side of the pier: past the Sun
        assert await client.ask(before_meridian, ending=NO_WAY) == NO_WAY
        beyond = b":Sr04:00:00#:Sd+40*00:00#:MS#"  # on the other side: by way of the pole
        assert await client.ask(beyond, ending=b"110") == b"110"
        assert await nearest(bridge, 120) >= 20.0


async def test_sun_distance_set_by_a_page_applies_to_the_running_motion_and_can_be_undone() -> None:
    async with Bridge("6-8se", start=JUNE, latency=0.05, config={"sun": 0.0}) as bridge:
        client, controller = bridge.client(), bridge.controller
        client.send(b":RS#:Me#")
        await asyncio.sleep(1.0)
        for wanted in (25.0, None, 25.0):
            era = controller.suns.reset_count
            controller.narrow_limits(sun=wanted)
            assert bool(controller.suns.suns_to_avoid()) is bool(wanted), "at once"
            assert controller.suns.reset_count != era, "what was measured before is not compared with what comes"
            await asyncio.sleep(0.8)
        assert 25.0 <= await nearest(bridge, 60) < 35.0
        assert not controller.moving
        controller.narrow_limits()
        client.send(b":Me#")
        assert await nearest(bridge, 10, done=lambda: distance(bridge) < 24.0) < 24.0
        controller.narrow_limits(sun=25.0)
        await asyncio.sleep(2.0)
        assert not controller.moving


@pytest.mark.parametrize(("latency", "rate"), [(0.05, b":RS#"), (0.2, b":RS#"), (0.2, b":RM#")])
@pytest.mark.safety_line(4)
async def test_motion_by_hand_stops_before_the_suns_circle_and_may_go_back(latency: float, rate: bytes) -> None:
    async with Bridge("6-8se", start=JUNE, latency=latency) as bridge:
        client = bridge.client()
        client.send(rate + b":Me#")  # azimuth falls, towards the Sun
        least = await nearest(bridge, 60)
        assert 20.0 <= least < 20.0 + 2 * 5.0, least
        assert not bridge.controller.moving
        client.send(b":Mw#")
        await asyncio.sleep(2)
        assert distance(bridge) > least + 0.1
        client.send(b":Q#")


async def test_nexstar_motion_by_hand_on_a_meade_stops_before_the_suns_circle() -> None:
    async with Bridge("autostar", driven="lx200", presented="nexstar", surface="6-8se", start=JUNE) as bridge:
        client = bridge.client()
        assert await client.ask(b"P\x02\x10\x25\x09\x00\x00\x00") == b"#"
        least = await nearest(bridge, 30)
        assert 20.0 <= least < 31.0, least
        assert b":Q#" in bridge.sent_requests() or "Too close to the Sun" in notes(bridge)
        assert not bridge.controller.moving


async def test_hand_control_without_pass_through_stops_stepping_at_the_suns_circle() -> None:
    config = {"site": (45.0, 10.0), "mode": "alt-az"}
    async with Bridge("nexstar-gps", "1.2", start=JUNE, config=config) as bridge:
        client = bridge.client()
        client.send(b":RS#:Mn#:Me#")  # steps of right ascension and declination: east and north
        assert await nearest(bridge, 40) >= 18.0
        assert not bridge.controller.moving
        before = len([sent for sent in bridge.sent_requests() if sent[:1] == b"R"])
        await asyncio.sleep(5)
        assert len([sent for sent in bridge.sent_requests() if sent[:1] == b"R"]) == before


@pytest.mark.safety_line(4)
async def test_motion_at_the_keypad_is_stopped_before_the_sun_while_a_program_polls() -> None:
    async with Bridge("6-8se", start=JUNE, latency=0.1) as bridge:
        client = bridge.client()
        for turn in range(60):
            client.send(b":GR#")
            await asyncio.sleep(0.25)
            if turn == 8:
                bridge.sim.mechanics.set_rate(bridge.clock(), 1, -4.0)
            assert distance(bridge) >= 19.5
        assert "stopped at the Sun" in notes(bridge)


async def test_mount_inside_the_suns_circle_may_leave_but_not_approach() -> None:
    async with Bridge("6-8se", start=MARCH) as bridge:
        client = bridge.client()
        await client.ask(b":GR#")
        assert distance(bridge) < 1.0
        client.send(b":RM#:Ms#")
        await asyncio.sleep(8)
        client.send(b":Qs#")
        await asyncio.sleep(1)
        out = distance(bridge)
        assert 5.0 < out < 20.0
        client.send(b":Mn#")
        assert await nearest(bridge, 10) > out - 2.0
        assert not bridge.controller.moving
        reply = await client.ask(b":Sr21:30:00#:Sd+00*00:00#:MS#", ending=b"110")
        assert reply == b"110"
        while await client.ask(b":D#") == b"\x7f#":
            assert distance(bridge) > out - 1.0
            await asyncio.sleep(0.5)
        assert distance(bridge) > 30.0


async def test_goto_that_deviates_towards_the_sun_is_stopped() -> None:
    async with Bridge("6-8se", start=JUNE) as bridge:
        client = bridge.client()
        assert await client.ask(FAR_ENOUGH, ending=b"110") == b"110"
        await asyncio.sleep(0.5)
        now = bridge.clock()
        bridge.sim.mechanics.goto_sky(now, *SKY.sun(now))  # as if the cable were wrapped round the other way
        assert await nearest(bridge, 60) > 14.0
        assert not bridge.controller.moving
        assert "stopped at the Sun" in notes(bridge)


def test_goto_near_the_sun_of_either_of_two_dates_is_refused() -> None:
    async def program(days: float) -> bytes:
        async with Bridge("6-8se", start=JUNE, host_ahead=days * 86400.0) as bridge:
            client = bridge.client()
            assert await client.ask(TO_IT, ending=NO) == NO
            august = b":Sr09:57:00#:Sd+12*00:00#:MS#"  # where it stands sixty days later
            reply = await client.ask(august, ending=b"#" if days else b"110")
            client.send(august)
            await asyncio.sleep(1)
            assert notes(bridge).count("UTC), so correct the one") == bool(days)
            return reply

    assert run(program(60.0)).startswith(b"112Near the Sun by the computer")
    assert run(program(0.0)) == b"110"
    assert EVENING < MARCH < JUNE


async def test_missing_mount_date_is_logged_once() -> None:
    async with Bridge("gt", "104.0", start=JUNE, config={"site": (45.0, 10.0), "mode": "alt-az"}) as bridge:
        bridge.site_clock.mount_clock = None
        client = bridge.client()
        for _ in range(2):
            assert (await client.ask(TO_IT, ending=b"Sun.#")).endswith(NO)
        assert notes(bridge).count("WARNING: the mount has reported no date") == 1


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "evolution"), ("lx200", "lx200gps")])
async def test_goto_to_the_zenith_is_judged_by_the_path_of_its_axes(driven: str, model: str) -> None:
    """The azimuth that was asked for counts, though every azimuth is the same place there."""
    async with Bridge(model, driven=driven, presented="nexstar", surface="6-8se", start=JUNE) as bridge:
        await bridge.client().ask(b"b6D82D800,40000000")  # azimuth 154, the zenith
        await asyncio.sleep(1.0)
        assert "way there passes too close" in notes(bridge)
        assert await nearest(bridge, 12.0) > 25.0


async def test_goto_during_a_pier_flip_is_checked_from_the_tubes_real_position() -> None:
    """Its hand control tells the side by the goal; a newer goto begins where the tube is."""
    config = {"mode": "eq-north"}
    async with Bridge("avx", "4.21", start=JUNE, config=config, latency=0.2) as bridge:
        controller = bridge.controller
        await controller.perform(op.Goto(355.2, 64.0))
        while controller.slewing:
            await asyncio.sleep(0.5)
        await controller.perform(op.Goto(143.9, 14.0))
        await asyncio.sleep(5.0)
        with pytest.raises(NearSun):
            await controller.perform(op.Goto(96.5, -41.3))


@pytest.mark.parametrize("latency", [0.05, 0.2])
async def test_goto_with_one_axis_ended_does_not_approach_the_sun(latency: float) -> None:
    """The second axis alone would take another way than the one that was checked: it is ended as well."""
    async with Bridge("evolution", start=JUNE, latency=latency) as bridge:
        controller, client = bridge.controller, bridge.client()
        await controller.perform(op.GotoHorizontal(165.3, 35.6))
        while controller.slewing:
            await asyncio.sleep(0.5)
        await controller.perform(op.GotoHorizontal(288.0, 60.0))
        await asyncio.sleep(0.5)
        client.send(b":Qe#")
        assert await nearest(bridge, 12.0) >= 20.0
        assert not bridge.sim.slewing
