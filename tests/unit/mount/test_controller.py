"""The hub: a hundred pollers cost what one costs, stop comes first, nobody disturbs another."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.errors import NoAnswer
from gateway.core.operations import AbortMotion, GetStatus, Goto, Position, Slewing
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.in_process_gateway import Bridge


async def _load(bridge: Bridge, clients: int, seconds: float) -> int:
    """Bytes on the mount's line while so many clients poll at 4 Hz."""
    visitors = [bridge.client(f"10.0.0.{n}") for n in range(clients)]
    await asyncio.sleep(1)
    before = sum(len(entry.data) for entry in bridge.entries if entry.side == "mount")
    for _ in range(round(seconds * 4)):
        for visitor in visitors:
            visitor.tell(b":GR#:GD#:D#")
        await asyncio.sleep(0.25)
    return sum(len(entry.data) for entry in bridge.entries if entry.side == "mount") - before


def test_twenty_pollers_cost_the_line_what_one_costs() -> None:
    async def program() -> None:
        async with Bridge(latency=0.1) as bridge:
            one = await _load(bridge, 1, 20)
            many = await _load(bridge, 20, 20)
            assert one == pytest.approx(many, rel=0.1)

    run(program())


def test_with_nobody_polling_there_are_two_questions_in_five_seconds_and_the_status_in_twelve() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            await asyncio.sleep(20)
            before = len(bridge.sent())
            await asyncio.sleep(60)
            asked = bridge.sent()[before:]
            assert 1 <= asked.count(b"e") <= 12
            assert 6 <= asked.count(b"w") <= 12, "its owner may set the site at its keys"
            status = asked.count(b"t") + asked.count(b"J")
            assert len(asked) - status <= 24 and asked.count(b"t") <= 6 and status <= 12

    run(program())


def test_reads_asked_at_the_same_time_share_one_exchange() -> None:
    async def program() -> None:
        async with Bridge(latency=0.3) as bridge:
            await asyncio.sleep(10)
            before = bridge.sent().count(b"e")
            answers = await asyncio.gather(*(bridge.controller.answer(Position()) for _ in range(50)))
            assert len(set(map(id, answers))) == 1
            assert bridge.sent().count(b"e") <= before + 1

    run(program())


def test_no_client_waits_for_a_slow_hand_control_while_it_polls() -> None:
    async def program() -> None:
        async with Bridge(latency=0.2) as bridge:
            client = bridge.client()
            await client.ask(b":GR#")
            for _ in range(40):
                await asyncio.sleep(0.25)
                client.heard = b""
                client.tell(b":GR#")
                assert client.heard.endswith(b"#"), "answered within the call that brought the bytes"

    run(program())


def test_stop_waits_for_the_exchange_on_the_wire_and_no_more() -> None:
    async def program() -> None:
        async with Bridge(latency=0.3) as bridge:
            client, other = bridge.client(), bridge.client("10.0.0.2")
            await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b"110")
            for _ in range(20):
                other.tell(b":GR#:GD#:GZ#:GA#:D#:GW#")
            await asyncio.sleep(0.31)
            asked = asyncio.get_running_loop().time()
            other.tell(b":Q#")
            before = len(bridge.sent())
            await asyncio.sleep(0.31)
            first = bridge.sent()[before : before + 2]
            assert b"M" in first[:2], first
            assert asyncio.get_running_loop().time() - asked < 0.62

    run(program())


def test_a_goto_that_waits_dies_by_a_stop() -> None:
    async def program() -> None:
        async with Bridge(latency=0.3) as bridge:
            client = bridge.client()
            client.tell(b":Sr07:00:00#:Sd+30*00:00#:MS#:Q#")
            await asyncio.sleep(5)
            assert client.heard.startswith(b"111")  # one for Sr, one for Sd, then the refusal
            assert not bridge.sim.slewing
            assert not [sent for sent in bridge.sent() if sent[:1] == b"r"]

    run(program())


def test_the_newer_goto_wins_and_both_see_it() -> None:
    async def program() -> None:
        async with Bridge(latency=0.1) as bridge:
            one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
            assert await one.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b"110") == b"110"
            await asyncio.sleep(2)
            assert await other.ask(b":Sr05:34:32#:Sd+22*00:52#:MS#", until=b"110") == b"110"
            assert await one.ask(b":Gr#:Gd#", until=b"00#") == b"07:00:00#+30*00:00#"
            while await one.ask(b":D#") == b"\x7f#":
                await asyncio.sleep(1)
            assert await one.ask(b":GR#") == b"05:34:32#"
            assert await other.ask(b":GR#") == b"05:34:32#"
            sent = bridge.sent()
            assert sent.index(b"M") < max(n for n, request in enumerate(sent) if request[:1] == b"r")

    run(program())


def test_two_moves_in_a_row_do_not_remember_off() -> None:
    async def program() -> None:
        async with Bridge(latency=0.1) as bridge:
            client = bridge.client()
            for _ in range(3):
                client.tell(b":RM#:Mn#:Mw#")
                await asyncio.sleep(0.15)
                client.tell(b":Qn#:Me#")
                await asyncio.sleep(0.15)
                client.tell(b":Qe#:Mn#:Qn#")
            await asyncio.sleep(5)
            assert bridge.sim.tracking
            assert bridge.sim.feed(b"t") == b"\x01#"

    run(program())


def test_a_drive_rate_comes_back_after_motion_and_goto() -> None:
    async def program() -> None:
        async with Bridge("cge") as bridge:
            client = bridge.client()
            client.tell(b":TL#")
            await asyncio.sleep(1)
            lunar = b"P\x03\x10\x06\xff\xfd\x00\x00"
            assert bridge.sent().count(lunar) == 1
            client.tell(b":RM#:Mn#")
            await asyncio.sleep(1)
            client.tell(b":Qn#")
            await asyncio.sleep(3)
            assert bridge.sent().count(lunar) == 2
            await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b"110")
            while await client.ask(b":D#") == b"\x7f#":
                await asyncio.sleep(1)
            await asyncio.sleep(1)
            assert bridge.sent().count(lunar) >= 3
            assert await client.ask(b":GT#") == b"58.7#"

    run(program())


def test_motion_stops_at_the_altitude_limit() -> None:
    async def program() -> None:
        async with Bridge("6-8se", config={"lowest": 20.0}) as bridge:
            client = bridge.client()
            client.tell(b":RM#:Ms#")
            for _ in range(60):
                await asyncio.sleep(1)
            altitude = float((await client.ask(b":GA#"))[1:3])
            assert 18 <= altitude <= 24
            assert not bridge.controller.moving

    run(program())


@pytest.mark.safety_line(8)
def test_an_unaligned_mount_refuses_gotos_with_words() -> None:
    async def program() -> None:
        async with Bridge(aligned=False) as bridge:
            reply = await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", until=b".#")
            assert reply == b"111Mount not aligned.#"

    run(program())


@each("mount", ["6-8se", "cge"])
@each("asked", [b":Sr07:00:00#:Sd+30*00:00#:CM#", b":Sz090*00#:Sa+40*00#:MA#", b":hP#"])
def test_an_unaligned_hand_control_takes_no_sync_and_no_axis_goto(mount: str, asked: bytes) -> None:
    """It says ``#`` to a sync and forgets it; to axis readings it goes, wherever they lead."""

    async def program() -> None:
        async with Bridge(mount, aligned=False) as bridge:
            reply = await bridge.client().ask(asked, 3.0, until=b"111")
            await asyncio.sleep(3.0)
            assert not [sent for sent in bridge.sent() if sent[:1] in b"sSbB"]
            assert not bridge.sim.slewing
            assert reply == {b"C": b"11#", b"M": b"111", b"h": b""}[asked.split(b":")[-1][:1]]
            assert any("Mount not aligned" in entry.note for entry in bridge.entries)

    run(program())


def test_an_owner_may_have_axis_gotos_without_an_alignment() -> None:
    async def program() -> None:
        async with Bridge("6-8se", aligned=False, config={"unaligned": "allow"}) as bridge:
            assert await bridge.client().ask(b":Sz090*00#:Sa+40*00#:MA#", until=b"110") == b"110"
            assert bridge.sim.slewing
            assert await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:CM#", until=b"#") == b"11#"

    run(program())


@pytest.mark.safety_line(8)
def test_a_meade_is_aligned_by_its_first_sync_at_any_distance() -> None:
    async def program() -> None:
        async with Bridge("autostar", driven="lx200", aligned=False) as bridge:
            await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:CM#", until=b"#")
            await asyncio.sleep(2.0)
            assert bridge.sim.aligned

    run(program())


def test_site_and_time_go_to_an_unaligned_mount_and_not_to_an_aligned_one() -> None:
    async def program(aligned: bool) -> None:
        async with Bridge(aligned=aligned) as bridge:
            client = bridge.client()
            asked = b":St-34*00#:Sg341*30#:SG-05.8#:SL04:00:00#:SC01/16/26#"
            assert (await client.ask(asked, until=b" " * 32 + b"#")).startswith(b"11111Updating")
            await asyncio.sleep(2)
            written = [sent for sent in bridge.sent() if sent[:1] in b"WH"]
            if aligned:
                assert written == []
            else:
                assert b"W\x22\x00\x00\x01\x12\x1e\x00\x00" in written
                assert any(sent[:1] == b"H" for sent in written)
                # 04:00 at +5:45 is 22:15 UTC; the hand control counts whole hours
                hour, minute, _, _, day, _, zone, _ = bridge.sim.feed(b"h")[:8]
                assert ((hour - zone) % 24, minute, day) == (22, 15, 16)
            assert await client.ask(b":Gt#:Gg#", until=b"30#") == b"-34*00#-018*30#"
            assert await client.ask(b":GC#") == b"01/16/26#"

    for aligned in (True, False):
        run(program(aligned))


def test_the_last_position_is_told_for_a_while_when_the_line_is_down() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            client = bridge.client()
            told = await client.ask(b":GR#")
            bridge.sim.feed = lambda data: b""
            bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
            await asyncio.sleep(2)
            assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#", until=b"11") == b"11"
            started = asyncio.get_running_loop().time()
            while bridge.controller.line.state == "up" and asyncio.get_running_loop().time() - started < 30:
                client.tell(b":GR#")
                await asyncio.sleep(0.5)
            assert told
            assert (await client.ask(b":MS#", 5, until=b"mount.#")).endswith(b"1No answer from mount.#")
            await asyncio.sleep(12)
            assert await client.ask(b":GR#", 3) == b""
            with pytest.raises(NoAnswer):
                await bridge.controller.answer(Position())

    run(program())


def test_slewing_holds_from_the_moment_it_was_asked_for() -> None:
    async def program() -> None:
        async with Bridge(latency=0.2) as bridge:
            task = asyncio.ensure_future(bridge.controller.perform(Goto(105.0, 30.0)))
            await asyncio.sleep(0.01)
            assert bridge.controller.peek(Slewing()) is True
            await task
            assert bridge.controller.peek(Slewing()) is True
            await bridge.controller.perform(AbortMotion())
            await asyncio.sleep(2.5)
            assert bridge.controller.peek(Slewing()) is False
            assert (await bridge.controller.answer(GetStatus())).aligned

    run(program())


def test_the_first_look_at_the_bars_while_another_program_starts_a_goto() -> None:
    async def program() -> None:
        async with Bridge(latency=0.1) as bridge:
            one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
            assert await other.ask(b":GR#")
            one.tell(b":Sr07:00:00#:Sd+30*00:00#:MS#")
            await asyncio.sleep(0.01)
            assert await other.ask(b":D#") == b"\x7f#"
            assert await other.ask(b":GR#")

    run(program())


def test_half_a_command_is_not_passed_by() -> None:
    async def program() -> None:
        async with Bridge(presented="nexstar", surface="6-8se") as bridge:
            client = bridge.client()
            assert len(await client.ask(b"e")) == 18
            assert len(await client.ask(b"e")) == 18
            client.tell(b"K")
            assert await client.ask(b"e") == b"e#"

    run(program())


def test_a_defect_in_a_driver_costs_one_operation() -> None:
    async def program() -> None:
        async with Bridge() as bridge:
            client = bridge.client()
            good = bridge.driver.handlers["pointing.position"]

            def broken(mount: object, operation: object) -> object:
                raise KeyError("a defect")

            await client.ask(b":GR#")
            bridge.driver.handlers = {**bridge.driver.handlers, "pointing.position": broken}
            for _ in range(20):
                client.tell(b":GR#")
                await asyncio.sleep(0.5)
            assert any("please report" in entry.note for entry in bridge.entries)
            bridge.driver.handlers = {**bridge.driver.handlers, "pointing.position": good}
            await asyncio.sleep(2)
            assert len(await client.ask(b":GR#")) == 9
            assert await client.ask(b":GVP#") == b"Autostar#"

    run(program())
