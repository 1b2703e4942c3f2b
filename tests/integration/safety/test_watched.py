"""What moves is looked at without a break: no command said again and no other read may hide it."""

from __future__ import annotations

import asyncio
from itertools import pairwise

import pytest
from msgspec.structs import replace

from gateway.app.mount_state import mount_state
from gateway.app.status import activity
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.mount.motion.seen import ObservedMotion
from gateway.mount.policy import Limits
from gateway.mount.readings.poller import SETTING_PERIOD
from gateway.mount.readings.rest import wait_for_rest
from tests.integration.safety.test_by_hand import UP, polled, ready
from tests.support.in_process_gateway import Bridge
from tests.support.looks import altitude, extremes, notes
from tests.support.sampling import as_a_rule


async def test_repeated_arrow_command_keeps_the_positions_measured_before() -> None:
    """What was seen before it still counts, and from when it was seen."""
    async with Bridge("cge", config={"lowest": 30.0}, latency=0.02) as bridge:
        client = bridge.client()
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Ms#")
        await asyncio.sleep(1.0)
        while bridge.controller.cache.age(op.Position, bridge.controller.now()) < 0.2:
            await asyncio.sleep(0.01)
        bridge.controller.watch.on_motion_start(bridge.controller.wanted.hand_moves[2])
        ra, dec = bridge.sim.mechanics.true_position(bridge.clock())
        await asyncio.sleep(0.02)
        bridge.controller.watch.check_position(op.Equatorial(ra, dec - 40.0))
        assert any("stopped at the altitude limit" in note for note in notes(bridge))


@pytest.mark.parametrize(("latency", "arrows", "height"), [
    (0.02, b":Ms#", 3.9), (0.02, b":Ms#", 4.1), (0.02, b":Mw#:Ms#", 2.6), (0.05, b":Ms#", 4.8), (0.2, b":Ms#", 6.0),
])  # fmt: skip
@pytest.mark.parametrize("model", ["lx200", "lx200gps"])
def test_arrow_just_above_a_limit_is_stopped_in_time(latency: float, arrows: bytes, height: float, model: str) -> None:
    """The first position after the beginning is too early to tell a rate."""

    async def program(lowest: float) -> None:
        async with Bridge(model, driven="lx200", config={"lowest": lowest}, latency=latency) as bridge:
            client = bridge.client()
            sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
            await bridge.controller.perform(op.Goto((sidereal - 45.0) % 360.0, 20.0))
            await ready(bridge, client, b":GR#")
            client.send(b":RS#" + arrows)
            low, _ = await extremes(bridge, 3.0)
            assert low >= lowest - 0.01
            assert notes(bridge)

    for step in range(0, 8, as_a_rule(5, whole=1)):
        run(program(45.4 - height + 0.05 * step))


@pytest.mark.parametrize("early", [5.4, 6.0, 6.6])
async def test_clock_is_not_read_while_the_mount_moves(early: float) -> None:
    """Three questions more on a slow line would be most of a second without a position."""
    async with Bridge("lx200gps", driven="lx200", latency=0.2) as bridge:
        client = bridge.client()
        said = bridge.site_clock.mount_clock
        assert said is not None
        while bridge.controller.now() < said[1] + SETTING_PERIOD - early - 0.5:
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        await asyncio.sleep(said[1] + SETTING_PERIOD - early - bridge.controller.now())
        began = bridge.clock()
        client.send(b":RS#:Mn#")
        for _ in range(10):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        seen = [
            entry.time
            for entry in bridge.entries
            if entry.side == "mount" and entry.data.startswith(b":GD") and entry.time > began
        ]
        gaps = [second - first for first, second in pairwise([began, *seen])]
        assert max(gaps) < 1.1, gaps
        client.send(b":Q#")
        for _ in range(16):  # one that is seen to run on is watched for three seconds more
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        assert bridge.controller.now() - bridge.site_clock.mount_clock[1] < 10.0  # but it is read when it rests


async def test_goto_stopped_on_its_way_keeps_the_tube_beyond_the_pole() -> None:
    """A Meade does not tell on which side its tube is: it stays where it was last seen to be."""
    async with Bridge("lx200", driven="lx200", config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 45.0) % 360.0, 80.0))
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Mn#")
        await polled(bridge, client, b":GR#", 8.0)
        client.send(b":Qn#")
        await asyncio.sleep(2.0)
        assert not bridge.controller.watch.observed.upright
        await bridge.controller.perform(op.Goto((sidereal - 60.0) % 360.0, -20.0))
        await asyncio.sleep(0.9)
        while bridge.controller.reader._shared_tasks:
            await asyncio.sleep(0.001)
        bridge.controller.begin_stop()
        while bridge.driver.goto is not None:
            await asyncio.sleep(0.001)
        assert bridge.controller.slewing
        await bridge.controller.reader.shared_task(
            op.Slewing()
        )  # the end of the goto is seen while the stop is on its way
        await asyncio.sleep(2.0)
        assert not bridge.controller.watch.observed.upright
        await bridge.controller.perform(op.Goto((sidereal - 60.0) % 360.0, 0.0))
        await ready(bridge, client, b":GR#")
        assert bridge.controller.watch.observed.upright


async def test_commands_without_an_answer_do_not_shorten_the_measured_reply_time() -> None:
    """How long a stop takes to come is reckoned from how long answers take."""
    async with Bridge("lx200gps", driven="lx200", latency=0.2) as bridge:
        for _ in range(20):
            await bridge.controller.reader.shared_task(op.Position())
        for _ in range(8):
            await bridge.controller.perform(op.StopAxis(2))
        assert bridge.controller.line.times.typical_rtt > 0.19


@pytest.mark.parametrize(("driven", "model"), [("lx200", "lx200gps"), ("nexstar", "cpc")])
async def test_motion_over_the_zenith_is_judged_along_its_whole_path(driven: str, model: str) -> None:
    """Where it would end, on the other side, it is low enough again."""
    async with Bridge(
        model, driven=driven, presented="nexstar", surface="6-8se", config={"highest": 88.0}, latency=0.2
    ) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(180.0, 87.0))
        await ready(bridge, client, b"e")
        assert altitude(bridge) == pytest.approx(87.0, abs=0.2)
        client.send(UP)
        _, high = await extremes(bridge, 3.0)
        assert high <= 88.0
        assert any("Object Above" in note for note in notes(bridge))


@pytest.mark.parametrize("arrow", [b":Me#", b":Mw#"])
async def test_position_read_in_two_halves_is_judged_at_the_second_instant(arrow: bytes) -> None:
    """Round the horizon at full speed, slowly sinking: right ascension is old when declination is told."""
    async with Bridge("autostar", driven="lx200", config={"lowest": 30.0}, latency=0.1) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(90.0, 30.6))
        await ready(bridge, client, b":GR#")
        client.send(b":RC#:Ms#")
        await asyncio.sleep(0.3)
        client.send(b":RS#" + arrow)
        low = 90.0
        for _ in range(40):
            client.send(b":GR#")
            low = min(low, (await extremes(bridge, 0.5))[0])
        assert low >= 29.99
        assert notes(bridge)


@pytest.mark.parametrize(("height", "stopped"), [(21.5, True), (26.0, False)])
async def test_axis_that_a_stop_ends_last_does_not_cross_a_limit_alone(height: float, stopped: bool) -> None:
    """Together they keep the altitude nearly; a stop ends them one after the other."""
    async with Bridge("cge", config={"lowest": 20.0}, latency=0.2) as bridge:
        await bridge.controller.perform(op.MoveAxis(1, 1, op.Rate(key=9)))
        await bridge.controller.perform(op.MoveAxis(2, 1, op.Rate(key=9)))
        look = bridge.controller.watch.check_position
        bridge.controller.reader.position_read.disconnect(look)  # only what is told here is looked at
        bridge.controller.watch.observed = ObservedMotion()
        for step in range(3):
            seen = bridge.controller.astrometry.equatorial_of(
                op.GotoHorizontal(200.0 + 3.0 * step, height - 0.05 * step)
            )
            look(op.Equatorial(seen.ra, seen.dec))
            await asyncio.sleep(0.5)
        assert any("stopped at the altitude limit" in note for note in notes(bridge)) is stopped


async def test_arrow_command_refused_when_sent_again_is_stopped() -> None:
    """The halt of the other axis came between: the mount had been told to move already."""
    south = (-35.0, 150.0)
    async with Bridge("lx200-16", driven="lx200", site=south, latency=0.02, config={"site": south}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 10.3) % 360.0, -23.6))
        await ready(bridge, client, b":GR#")
        client.send(b":RM#:Mn#")
        await asyncio.sleep(0.3)
        client.send(b":Me#")
        while b":Me#" not in bridge.sent_requests():
            await asyncio.sleep(0.001)
        bridge.controller.context.policy = replace(
            bridge.controller.policy, limits=Limits(highest=altitude(bridge) + 0.1)
        )
        client.send(b":Qn#")
        await asyncio.sleep(0.3)
        assert any("Object Above" in note for note in notes(bridge))
        before = bridge.sim.mechanics.axes(bridge.clock())
        await asyncio.sleep(1.0)
        assert bridge.sim.mechanics.axes(bridge.clock()) == pytest.approx(before, abs=0.01)
        assert not bridge.controller.moving


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "cge"), ("lx200", "lx200")])
async def test_remaining_axis_does_not_cross_a_limit_after_the_other_ends(driven: str, model: str) -> None:
    """North lifts the tube there as fast as west lowers it."""
    async with Bridge(model, driven=driven, config={"lowest": 20.0}, latency=0.05) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 80.0) % 360.0, 20.0))
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Mn#:Mw#")
        lows = []
        for _ in range(8):
            lows.append((await extremes(bridge, 0.05))[0])
        bridge.controller.context.policy = replace(bridge.controller.policy, limits=Limits(lowest=lows[-1] - 0.4))
        client.send(b":Qn#")
        low, _ = await extremes(bridge, 3.0)
        assert low >= lows[-1] - 0.4
        assert not bridge.controller.moving


def test_motion_right_after_a_stop_is_watched_from_its_first_position() -> None:
    """The mount was seen to coast after the stop, as if somebody else moved it."""

    async def program(height: float) -> None:
        async with Bridge(
            "i-series", presented="nexstar", surface="cpc", config={"highest": 75.0}, latency=0.2
        ) as bridge:
            client = bridge.client()
            await bridge.controller.perform(op.GotoHorizontal(16.0, height))
            await ready(bridge, client, b"e")
            bridge.controller.watch._moved_by_others_until = bridge.controller.now() + 3.0
            client.send(UP)
            high = 0.0
            for _ in range(20):
                client.send(b"z")
                high = max(high, (await extremes(bridge, 0.2))[1])
            assert high <= 75.0, height

    for step in range(0, 8, as_a_rule(2, whole=1)):
        run(program(69.0 + 0.25 * step))


@pytest.mark.parametrize("late", [0.0, 0.2])
def test_arrow_right_after_a_stop_is_judged_from_where_the_mount_rests(late: float) -> None:
    """Not where it was seen last, on its way; it runs on to 25.9 degrees, and no limit may lie above that."""

    async def program(lowest: float) -> None:
        async with Bridge("lx200", driven="lx200", latency=0.02) as bridge:
            client = bridge.client()
            sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
            await bridge.controller.perform(op.Goto((sidereal - 1.0) % 360.0, -40.0))
            while altitude(bridge) > 30.0 or bridge.controller.cache.age(op.Position, bridge.controller.now()) < late:
                await asyncio.sleep(0.01 if altitude(bridge) < 33.0 else 0.1)
            await bridge.controller.stop()
            bridge.controller.context.policy = replace(bridge.controller.policy, limits=Limits(lowest=lowest))
            client.send(b":RS#:Ms#")
            low, _ = await extremes(bridge, 3.0)
            assert low >= lowest

    for lowest in (20.4, 22.0, 22.4, 23.0, 23.6, 25.6):
        run(program(lowest))


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "cge"), ("lx200", "lx200gps")])
def test_mount_resting_after_a_stop_is_not_taken_for_moved_by_hand(driven: str, model: str) -> None:
    """While it ran on, it was seen to move without an order; that is over once it was seen at rest."""

    async def program(wait: float) -> None:
        async with Bridge(model, driven=driven, config={"sun": 0.0}, latency=0.02) as bridge:
            controller = bridge.controller
            await controller.perform(op.Goto(120.0, 30.0))
            await asyncio.sleep(wait)
            await controller.stop()
            await wait_for_rest(controller.context, controller.reader)
            for _ in range(30):
                assert activity(mount_state(controller).look) != "moved by hand", wait
                await controller.read_now(op.Position())
                await asyncio.sleep(0.1)

    for step in range(10):
        run(program(3.0 + 0.13 * step))


async def test_hour_angle_narrowed_by_a_page_applies_to_the_running_motion() -> None:
    async with Bridge("cge", config={"hour_angle_limit": 4.0}, latency=0.02) as bridge:
        client = bridge.client()
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Mw#")
        await asyncio.sleep(1.0)
        bridge.controller.narrow_limits(hour_angle=20.0)
        await asyncio.sleep(30.0)  # it began 90 degrees before the meridian, with 4.5 degrees a second
        assert any("stopped at the hour angle limit" in note for note in notes(bridge))


async def test_limits_narrowed_by_a_page_apply_to_the_running_motion() -> None:
    async with Bridge("cge", config={"lowest": 10.0}, latency=0.02) as bridge:
        client = bridge.client()
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Ms#")
        await asyncio.sleep(1.0)
        lowest = altitude(bridge) - 4.0
        bridge.controller.narrow_limits(lowest=lowest)
        await asyncio.sleep(10.0)
        assert any("stopped at the altitude limit" in note for note in notes(bridge))
        assert altitude(bridge) > lowest - 1.5 > 11.0
