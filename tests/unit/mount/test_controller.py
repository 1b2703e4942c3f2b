"""The hub: a hundred pollers cost what one costs, stop comes first, nobody disturbs another."""

from __future__ import annotations

import asyncio

import pytest

from gateway.core.operations import Position
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.in_process_gateway import Bridge


async def test_unpolled_mount_is_asked_twice_in_five_seconds_and_for_status_every_twelve() -> None:
    async with Bridge() as bridge:
        await asyncio.sleep(20)
        before = len(bridge.sent_requests())
        await asyncio.sleep(60)
        asked = bridge.sent_requests()[before:]
        assert 1 <= asked.count(b"e") <= 12
        assert 6 <= asked.count(b"w") <= 12, "its owner may set the site at its keys"
        status = asked.count(b"t") + asked.count(b"J")
        assert len(asked) - status <= 24 and asked.count(b"t") <= 6 and status <= 12


async def test_simultaneous_reads_share_one_exchange() -> None:
    async with Bridge(latency=0.3) as bridge:
        await asyncio.sleep(10)
        before = bridge.sent_requests().count(b"e")
        answers = await asyncio.gather(*(bridge.controller.answer(Position()) for _ in range(50)))
        assert len(set(map(id, answers))) == 1
        assert bridge.sent_requests().count(b"e") <= before + 1


async def test_no_client_waits_for_a_slow_hand_control_while_it_polls() -> None:
    async with Bridge(latency=0.2) as bridge:
        client = bridge.client()
        await client.ask(b":GR#")
        for _ in range(40):
            await asyncio.sleep(0.25)
            client.received = b""
            client.send(b":GR#")
            assert client.received.endswith(b"#"), "answered within the call that brought the bytes"


@pytest.mark.safety_line(8)
async def test_unaligned_mount_refuses_gotos_with_a_reason() -> None:
    async with Bridge(aligned=False) as bridge:
        reply = await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", ending=b".#")
        assert reply == b"111Mount not aligned.#"


@each("mount", ["6-8se", "cge"])
@each("asked", [b":Sr07:00:00#:Sd+30*00:00#:CM#", b":Sz090*00#:Sa+40*00#:MA#", b":hP#"])
async def test_unaligned_hand_control_refuses_syncs_and_axis_gotos(mount: str, asked: bytes) -> None:
    """It says ``#`` to a sync and forgets it; to axis readings it goes, wherever they lead."""
    async with Bridge(mount, aligned=False) as bridge:
        reply = await bridge.client().ask(asked, 3.0, ending=b"111")
        await asyncio.sleep(3.0)
        assert not [sent for sent in bridge.sent_requests() if sent[:1] in b"sSbB"]
        assert not bridge.sim.slewing
        assert reply == {b"C": b"11#", b"M": b"111", b"h": b""}[asked.split(b":")[-1][:1]]
        assert any("Mount not aligned" in entry.note for entry in bridge.entries)


async def test_owner_may_allow_axis_gotos_without_an_alignment() -> None:
    async with Bridge("6-8se", aligned=False, config={"unaligned": "allow"}) as bridge:
        assert await bridge.client().ask(b":Sz090*00#:Sa+40*00#:MA#", ending=b"110") == b"110"
        assert bridge.sim.slewing
        assert await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:CM#", ending=b"#") == b"11#"


@pytest.mark.safety_line(8)
async def test_first_sync_aligns_a_meade_at_any_distance() -> None:
    async with Bridge("autostar", driven="lx200", aligned=False) as bridge:
        await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:CM#", ending=b"#")
        await asyncio.sleep(2.0)
        assert bridge.sim.aligned


def test_site_and_time_are_sent_to_unaligned_mounts_only() -> None:
    async def program(aligned: bool) -> None:
        async with Bridge(aligned=aligned) as bridge:
            client = bridge.client()
            asked = b":St-34*00#:Sg341*30#:SG-05.8#:SL04:00:00#:SC01/16/26#"
            assert (await client.ask(asked, ending=b" " * 32 + b"#")).startswith(b"11111Updating")
            await asyncio.sleep(2)
            written = [sent for sent in bridge.sent_requests() if sent[:1] in b"WH"]
            if aligned:
                assert written == []
            else:
                assert b"W\x22\x00\x00\x01\x12\x1e\x00\x00" in written
                assert any(sent[:1] == b"H" for sent in written)
                # 04:00 at +5:45 is 22:15 UTC; the hand control counts whole hours
                hour, minute, _, _, day, _, zone, _ = bridge.sim.feed(b"h")[:8]
                assert ((hour - zone) % 24, minute, day) == (22, 15, 16)
            assert await client.ask(b":Gt#:Gg#", ending=b"30#") == b"-34*00#-018*30#"
            assert await client.ask(b":GC#") == b"01/16/26#"

    for aligned in (True, False):
        run(program(aligned))


async def test_lx200_distance_bars_show_a_goto_that_another_program_just_started() -> None:
    async with Bridge(latency=0.1) as bridge:
        one, other = bridge.client("10.0.0.1"), bridge.client("10.0.0.2")
        assert await other.ask(b":GR#")
        one.send(b":Sr07:00:00#:Sd+30*00:00#:MS#")
        await asyncio.sleep(0.01)
        assert await other.ask(b":D#") == b"\x7f#"
        assert await other.ask(b":GR#")


async def test_next_byte_completes_an_unfinished_nexstar_echo_command() -> None:
    async with Bridge(presented="nexstar", surface="6-8se") as bridge:
        client = bridge.client()
        assert len(await client.ask(b"e")) == 18
        assert len(await client.ask(b"e")) == 18
        client.send(b"K")
        assert await client.ask(b"e") == b"e#"


async def test_driver_defect_fails_only_one_operation() -> None:
    async with Bridge() as bridge:
        client = bridge.client()
        good = bridge.driver.handlers["pointing.position"]

        def broken(mount: object, operation: object) -> object:
            raise KeyError("a defect")

        await client.ask(b":GR#")
        bridge.driver.handlers = {**bridge.driver.handlers, "pointing.position": broken}
        for _ in range(20):
            client.send(b":GR#")
            await asyncio.sleep(0.5)
        assert any("please report" in entry.note for entry in bridge.entries)
        bridge.driver.handlers = {**bridge.driver.handlers, "pointing.position": good}
        await asyncio.sleep(2)
        assert len(await client.ask(b":GR#")) == 9
        assert await client.ask(b":GVP#") == b"Autostar#"
