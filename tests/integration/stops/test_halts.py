"""Equal halts are one: none is lost that ends something, and a flood of them leaves the line to others."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gateway.astro.spherical import wrap180
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.operations_matrix import _axes
from tests.support.sampling import as_a_rule

LATENCY = 0.1
NORTH_STOPS, EAST_STOPS = b"P\x02\x11\x24\0\0\0\0", b"P\x02\x10\x24\0\0\0\0"
#: A hand control's keys, by the NexStar protocol: device, direction, key.
MOTORS = {
    "lx200": [(b":Mn#", 2), (b":Ms#", 2), (b":Me#", 1), (b":Mw#", 1)],
    "nexstar": [
        (b"P\x02\x10\x24\x07\0\0\0", 1),
        (b"P\x02\x10\x25\x07\0\0\0", 1),
        (b"P\x02\x11\x24\x07\0\0\0", 2),
        (b"P\x02\x11\x25\x07\0\0\0", 2),
    ],
}
ENDS = {
    "lx200": [(b":Qn#", 2), (b":Qs#", 2), (b":Qe#", 1), (b":Qw#", 1)],
    "nexstar": [
        (b"P\x02\x10\x24\0\0\0\0", 1),
        (b"P\x02\x10\x25\0\0\0\0", 1),
        (b"P\x02\x11\x24\0\0\0\0", 2),
        (b"P\x02\x11\x25\0\0\0\0", 2),
        (b"P\x03\x11\x06\0\0\0\0", 2),
    ],
}


@pytest.mark.parametrize(
    ("presented", "driven", "mount"), [("lx200", "nexstar", "6-8se"), ("nexstar", "lx200", "lx200gps")]
)
def test_axis_obeys_the_last_of_many_arrow_and_stop_commands(presented: str, driven: str, mount: str) -> None:
    """Whoever said it, how often, and whatever it came between."""
    said = st.tuples(
        st.booleans(),
        st.integers(0, 3),
        st.sampled_from((1, 1, 1, 2, 30)),
        st.integers(0, 2),
        st.sampled_from((0.0, 0.0, 0.0, 0.01, 0.11, 0.35)),
    )

    @settings(max_examples=as_a_rule(10, whole=15), deadline=None)
    @given(st.lists(said, max_size=12))
    @example([(False, 2, 1, 0, 0.0), (True, 2, 1, 0, 0.0), (False, 2, 1, 0, 0.0)])
    @example([(False, 0, 1, 0, 0.0), (True, 0, 1, 1, 0.0), (False, 0, 30, 0, 0.0)])
    @example([(True, 0, 1, 1, 0.11), (True, 0, 1, 0, 0.0), (True, 0, 1, 0, 0.0), (False, 0, 1, 1, 0.0)])
    @example([(False, 0, 1, 0, 0.0)] * 7 + [(True, 0, 1, 0, 0.0), (True, 2, 1, 2, 0.0), (False, 0, 1, 0, 0.0),
                                            (False, 2, 1, 2, 0.0), (True, 0, 1, 0, 0.0)])  # fmt: skip
    @example([(False, 0, 30, 0, 0.35)] * 4 + [(True, 0, 1, 1, 0.11), (False, 0, 1, 0, 0.0)])
    def judged(sequence: list[tuple[bool, int, int, int, float]]) -> None:
        run(program(sequence))

    async def program(sequence: list[tuple[bool, int, int, int, float]]) -> None:
        async with Bridge(
            mount,
            driven=driven,
            presented=presented,
            latency=LATENCY,
            surface="autostar" if presented == "lx200" else "6-8se",
        ) as bridge:
            clients = [bridge.client(f"10.0.0.{number}") for number in range(3)]
            for client in clients:
                client.send(b":RC#" if presented == "lx200" else b"")
            turning, speaking, words = {1: False, 2: False}, 0, b""
            held: dict[int, set[int]] = {1: set(), 2: set()}  # by whom; a release leaves another program's press alone
            for begins, which, times, who, pause in sequence:
                command, axis = (MOTORS if begins else ENDS)[presented][which]
                if who != speaking or pause:  # else it is one write
                    clients[speaking].send(words)
                    words = b""
                    await asyncio.sleep(pause)
                speaking, words = who, words + command * (min(times, 2) if begins else times)
                turning[axis] = begins
                held[axis] = held[axis] | {who} if begins else held[axis] - {who}
            clients[speaking].send(words)
            await asyncio.sleep(4.0)
            for client in clients:  # somebody is there all the time
                client.send(b":GR#" if presented == "lx200" else b"e")
            turns = bridge.controller.wanted.axes_moved_by_hand
            # On a slow line an arrow or a tap may come too late, and that is told.
            told = ("this motion was not started", "came too late to be carried out")
            late = any(words in entry.note for entry in bridge.entries for words in told)
            begun = {axis for axis in turning if turning[axis] and not late}
            assert begun <= turns <= {axis for axis in held if held[axis]}, sequence
            before = _axes(bridge)
            await asyncio.sleep(1.0)
            turned = [abs(wrap180(now - then)) for now, then in zip(_axes(bridge), before, strict=True)]
            assert [degrees > 0.02 for degrees in turned] == [1 in turns, 2 in turns], (sequence, turned)

    judged()


@pytest.mark.parametrize("flood", [b":Qe#", b":Qn#:Qs#:Qe#:Qw#", b"M" + EAST_STOPS])
async def test_flood_of_halts_starts_no_tasks(flood: bytes) -> None:
    shown = {"presented": "lx200"} if flood[:1] == b":" else {"presented": "nexstar", "surface": "6-8se"}
    async with Bridge("cge", latency=LATENCY, **shown) as bridge:
        before = len(asyncio.all_tasks())
        crowd = [bridge.client(f"10.0.1.{number}") for number in range(50)]
        for client in crowd:
            client.send(flood * 20)
        await asyncio.sleep(0.05)
        assert len(asyncio.all_tasks()) <= before + 10
        if flood[:1] != b":":
            assert all(client.received == b"#" * 40 for client in crowd), "every one is answered"


@pytest.mark.parametrize("flood", [b":Qe#", b":Qn#:Qe#", b"M", EAST_STOPS + NORTH_STOPS])
async def test_position_read_does_not_wait_for_a_flood_of_halts(flood: bytes) -> None:
    lx200 = flood[:1] == b":"
    shown: dict[str, Any] = {"presented": "lx200"} if lx200 else {"presented": "nexstar", "surface": "6-8se"}
    async with Bridge("cge", latency=LATENCY, **shown) as bridge:
        bully, other = bridge.client("10.0.0.66"), bridge.client("10.0.0.1")
        loop = asyncio.get_running_loop()

        async def pour() -> None:
            while True:
                bully.send(flood * 10)
                await asyncio.sleep(0.02)

        pouring = bridge.controller.spawn(pour())
        waits = []
        for _ in range(50):
            began = loop.time()
            assert await other.ask(b":GR#" if lx200 else b"e", 20.0, ending=b"#")
            waits.append(loop.time() - began)
            await asyncio.sleep(0.1)
        assert max(waits[10:]) <= 0.1, "answered from what the mount has said"
        pouring.cancel()


async def test_flood_of_halts_on_one_axis_lets_the_other_move() -> None:
    async with Bridge("cge", latency=LATENCY) as bridge:
        bully, other = bridge.client("10.0.0.66"), bridge.client("10.0.0.1")

        async def pour() -> None:
            while True:
                bully.send(b":Qe#" * 10)
                await asyncio.sleep(0.02)

        pouring = bridge.controller.spawn(pour())
        await asyncio.sleep(3.0)
        other.send(b":RM#:Mn#")
        await asyncio.sleep(2.0)
        assert bridge.controller.wanted.axes_moved_by_hand == {2}
        asked = bridge.clock()
        other.send(b":Qn#")
        await asyncio.sleep(1.0)
        sent = [
            entry.time - asked
            for entry in bridge.entries
            if entry.data == NORTH_STOPS and entry.arrow == ">" and entry.time >= asked
        ]
        assert sent[0] <= LATENCY + 0.001
        pouring.cancel()


async def test_halt_requested_twice_is_sent_twice_at_once() -> None:
    """The first may have been lost."""
    async with Bridge("cge", latency=LATENCY) as bridge:
        client, other = bridge.client(), bridge.client("10.0.0.2")
        client.send(b":RM#:Me#")
        await asyncio.sleep(2.0)
        for _ in range(2):
            other.send(b":GA#:GZ#:GW#:GC#")
            await asyncio.sleep(0.01)
            asked = bridge.clock()
            client.send(b":Qe#")
            await asyncio.sleep(0.4)
            times = [
                entry.time - asked
                for entry in bridge.entries
                if entry.data == EAST_STOPS and entry.arrow == ">" and entry.time >= asked
            ]
            assert times
            assert times[0] <= LATENCY + 0.001


async def test_many_halts_behind_a_goto_end_it_by_one_stop() -> None:
    async with Bridge("cge", latency=LATENCY) as bridge:
        bridge.client().send(b":Sr07:00:00#:Sd+30*00:00#:MS#")
        await asyncio.sleep(0.02)
        for number in range(20):
            bridge.client(f"10.0.0.{number}").send(b":Qe#")
        await asyncio.sleep(2.0)
        assert bridge.sent_requests().count(b"M") == 1
        assert not bridge.sim.slewing


async def test_halt_behind_each_of_two_gotos_ends_both() -> None:
    async with Bridge("cge", latency=LATENCY) as bridge:
        for goto in (b":Sr07:00:00#:Sd+30*00:00#:MS#", b":Sr07:10:00#:Sd+31*00:00#:MS#"):
            bridge.client(f"10.0.0.{goto[5]}").send(goto)
            await asyncio.sleep(0.02)
            bridge.client().send(b":Qe#")
        await asyncio.sleep(4.0)
        assert not bridge.sim.slewing
        assert bridge.sim.tracking
