"""Work that takes a Meade minutes, and what it must not hold up: a stop."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Busy, Refused, Unsupported
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge


def meade(model: str = "lx200gps", **settings: Any) -> Bridge:
    return Bridge(model, driven="lx200", surface=settings.pop("surface", model), **settings)


async def test_stop_alone_is_sent_while_the_gps_is_queried() -> None:
    async with meade() as bridge:
        asking, other = bridge.client(), bridge.client("10.0.0.2")
        await other.ask(b":GR#")
        asking.send(b":gT#")
        await asyncio.sleep(2.0)
        assert bridge.controller.line.state == "busy"
        before = len(bridge.sent_requests())
        assert await other.ask(b":GR#", 0.2) != b""  # the last position, for a while
        other.send(b":Q#")
        await asyncio.sleep(0.001)
        assert bridge.sent_requests()[before:] == [b":Q#"]
        assert not bridge.controller.wanted.stop_owed
        other.send(b":Mn#")
        await asyncio.sleep(10.0)
        assert await other.ask(b":GR#", 5.0) == b""
        assert bridge.sent_requests()[before:] == [b":Q#"]
        await asyncio.sleep(60.0)
        assert asking.received == b"1"
        assert bridge.controller.line.state == "up"
        assert (await other.ask(b":GR#")).endswith(b"#")
        assert bridge.sim.mechanics.axes(bridge.sim.now)[1] == pytest.approx(45.0, abs=1.0)  # :Mn never came


async def test_gps_is_not_queried_while_the_mount_moves() -> None:
    async with meade() as bridge:
        client = bridge.client()
        client.send(b":RG#:Mn#")
        await asyncio.sleep(1.0)
        assert await client.ask(b":gT#") == b"0"
        assert b":gT#" not in bridge.sent_requests()


@pytest.mark.parametrize(("model", "gps", "set_"), [("cge", {}, False), ("cpc", {"gps_linked": True}, True)])
async def test_clock_not_set_by_a_gps_is_not_reported_as_gps_time(model: str, gps: dict[str, Any], set_: bool) -> None:
    async with Bridge(model, surface="lx200gps") as bridge:
        assert await bridge.client().ask(b":gT#", 5.0) == (b"1" if set_ else b"0")
        said = any("set by the GPS" in entry.note for entry in bridge.entries)
        assert said is set_


async def test_stop_does_not_wait_while_a_classic_calculates_its_planets() -> None:
    async with meade("lx200") as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.SetClock(bridge.clock() + 86400.0, 0.0))
        await asyncio.sleep(1.0)
        goal = bridge.sim.mechanics.sky.lst(bridge.clock()) + 40.0
        bridge.sim.mechanics.goto_sky(bridge.sim.now, goal, 20.0)  # by its own keys
        assert bridge.sim.slewing and bridge.sent_requests()[-1].startswith(b":SC")
        client.send(b":Q#")
        await asyncio.sleep(0.01)
        assert bridge.sent_requests()[-1] == b":Q#"
        await asyncio.sleep(0.5)
        assert not bridge.sim.slewing


async def test_meade_gets_no_other_request_while_it_seeks_home() -> None:
    async with meade("lx200-16") as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.Goto(bridge.sim.mechanics.sky.lst(bridge.clock()) + 60.0, 20.0))
        await asyncio.sleep(60.0)
        client.send(b":hF#")
        for _ in range(10):
            await client.ask(b":GR#", 0.5)
            await asyncio.sleep(0.5)
        assert set(bridge.sent_requests()[bridge.sent_requests().index(b":hF#") :]) <= {b":Q#", b":hF#", b":h?#"}
        assert await client.ask(b":h?#") == b"2"
        assert bridge.controller.line.state == "up"
        with pytest.raises(Busy):
            await bridge.controller.perform(op.TrackRate(name="lunar"))
        client.send(b":Q#")
        await asyncio.sleep(0.3)
        assert await client.ask(b":h?#") == b"0"
        client.send(b":hF#")
        await asyncio.sleep(60.0)
        assert await client.ask(b":h?#") == b"1"
        assert (await client.ask(b":GR#")).endswith(b"#")


async def test_arrow_answered_with_nak_counts_as_refused() -> None:
    """An LX200GPS says NAK to an arrow while it is busy; the arrow is refused, neither believed nor begun later."""
    async with meade(latency=0.01) as bridge:
        bridge.sim.busy_until = bridge.clock() + 1.0
        with pytest.raises(Busy):
            await bridge.controller.perform(op.Move(op.Direction.NORTH, op.Rate(name="find")))
        await asyncio.sleep(3.0)
        assert bridge.sim.arrows == {}
        await bridge.controller.perform(op.Move(op.Direction.NORTH, op.Rate(name="find")))
        assert bridge.sim.arrows == {2: False}


async def test_one_gps_sentence_answers_every_request_for_five_minutes() -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cpc") as bridge:
        client = bridge.client()
        assert await client.ask(b"P\x01\xb0\x37\0\0\0\x01") == b"\x01#"
        latitude = await client.ask(b"P\x01\xb0\x01\0\0\0\x03")
        assert int.from_bytes(latitude[:3]) * 360 / 2**24 == pytest.approx(45.0, abs=0.001)
        first = await client.ask(b"P\x01\xb0\x33\0\0\0\x03")
        await asyncio.sleep(240.0)
        later = await client.ask(b"P\x01\xb0\x33\0\0\0\x03")
        assert later[0] * 60 + later[1] == first[0] * 60 + first[1] + 4
        assert bridge.sent_requests().count(b":gps#") == 1
        await asyncio.sleep(70.0)
        await client.ask(b"P\x01\xb0\x37\0\0\0\x01")
        assert bridge.sent_requests().count(b":gps#") == 2
        assert b":gT#" not in bridge.sent_requests()


async def test_meade_arrow_runs_at_the_requested_fastest_rate() -> None:
    async with meade() as bridge:
        client = bridge.client()
        await client.ask(b":Sw3#")
        client.send(b":RS#:Mw#")
        await asyncio.sleep(0.5)
        assert bridge.sim.mechanics.max_rate == 3.0
        client.send(b":Qw#")
        other = bridge.client("10.0.0.2")
        other.send(b":RS#:Mn#")
        await asyncio.sleep(0.5)
        assert bridge.sim.mechanics.max_rate == 8.0


async def test_fan_and_derotator_are_switched_only_on_mounts_that_have_them() -> None:
    async with meade("lx200-16") as bridge:
        bridge.client().send(b":f+#:r+#:B+#")
        await asyncio.sleep(1.0)
        assert bridge.sim.accessories == {"fan": True, "derotator": True, "reticle": 1}
    async with meade("autostar", surface="lx200gps") as bridge:
        before = len(bridge.sent_requests())
        assert await bridge.client().ask(b":f+#:fT#:Gc#") == b"24#"
        assert b":f+#" not in bridge.sent_requests()[before:]


@pytest.mark.parametrize(("factor", "sent"), [(1.0, b":TQ#"), (0.99996, b":TQ#"), (0.94, b":ST056.6#")])
async def test_classic_tracks_at_the_requested_rate(factor: float, sent: bytes) -> None:
    async with meade("lx200") as bridge:
        await bridge.controller.perform(op.TrackRate(factor=factor))
        assert sent in bridge.sent_requests()


async def test_classic_refuses_a_tracking_rate_beyond_its_range() -> None:
    """56.4 to 60.1 hertz: half the sidereal rate is 30.1."""
    async with meade("lx200") as bridge:
        with pytest.raises(Refused, match=r"56\.4 to 60\.1"):
            await bridge.controller.perform(op.TrackRate(factor=0.5))
        assert b":TM#" not in bridge.sent_requests()


async def test_pec_toggle_is_sent_once_when_the_same_state_is_set_twice() -> None:
    async with meade("lx200") as bridge:
        for on in (True, True, False, False):
            await bridge.controller.perform(op.PeriodicError(1, on))
        assert sum(b"$Q" in request for request in bridge.sent_requests()) == 2
        with pytest.raises(Unsupported):
            await bridge.controller.perform(op.Park())


async def test_halt_overtakes_the_pending_read_of_its_client() -> None:
    """The client's position is still on its way when it lets go of the arrow; an arrow behind it is not begun."""
    async with meade("autostar", latency=0.4) as bridge:
        client = bridge.client()
        client.send(b":Mn#")
        await asyncio.sleep(1.5)
        client.send(b":GR#")
        client.send(b":Me#:Mn#:Qn#")
        await asyncio.sleep(6.0)
        sent = bridge.sent_requests()
        assert b":Qn#" in sent
        assert sent.count(b":Mn#") == 1
        assert b":Me#" in sent
        assert bridge.sim.arrows.keys() == {1}


@pytest.mark.parametrize("driven", ["lx200", "nexstar"])
@pytest.mark.parametrize("latitude", [45.0, -34.0])
def test_arrows_go_the_right_way_on_a_polar_fork(driven: str, latitude: float) -> None:
    """The same arrow on a Meade and on a Celestron fork on its wedge."""

    async def program() -> None:
        model = "lx200" if driven == "lx200" else "cpc"
        async with Bridge(
            model, driven=driven, site=(latitude, 10.0), aligned=driven == "lx200", config={"lowest": -90.0}
        ) as bridge:
            if driven == "nexstar":
                bridge.sim.aligned = True
                bridge.sim.track(2 if latitude > 0 else 3)
                bridge.controller.cache.forget(op.GetStatus)
                await bridge.controller.answer(op.GetStatus())

            async def moved(operation: op.Operation, axis: int) -> tuple[float, float]:
                ra, dec = bridge.sim.true_position()
                await bridge.controller.perform(operation)
                await asyncio.sleep(2.0)
                await bridge.controller.perform(op.StopAxis(axis))
                after = bridge.sim.true_position()
                return (after[0] - ra + 180.0) % 360.0 - 180.0, after[1] - dec

            rate = op.Rate(name="find")
            assert (await moved(op.Move(op.Direction.NORTH, rate), 2))[1] > 0.5
            assert (await moved(op.Move(op.Direction.WEST, rate), 1))[0] < -0.5
            up = (await moved(op.MoveAxis(2, 1, rate), 2))[1]
            assert up * latitude > 0.5  # a fork rises towards the pole that is up
            assert (await moved(op.MoveAxis(1, 1, rate), 1))[0] * latitude < -0.5  # west in the north

    run(program())
