"""Connections of a port for every protocol, over a whole gateway on virtual time."""

from __future__ import annotations

import asyncio
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.diagnostics.virtual_time import run
from tests.support import exact_sky
from tests.support.any_port import AnyBridge
from tests.support.sampling import as_a_rule

GOTO = struct.pack("<HHQIi", 20, 0, 0, round(83.633 / 360 * 2**32), round(22.0145 / 360 * 2**32))
#: What is sent first, what the answer ends with, and what is spoken.
FIRST = [
    (b":GR#", b"#", 9, "lx200"),
    (b"#:GR#", b"#", 9, "lx200"),
    (b"\x06", b"A", 1, "lx200"),
    (b":GVP#", b"#", 9, "lx200"),
    (b"E", b"#", 10, "nexstar"),
    (b"?e", b"#", 18, "nexstar"),
    (b"V", b"#", 3, "nexstar"),
    (b"P\x01\x10\xfe\0\0\0\x02", b"#", 3, "nexstar"),
]
#: Pieces that begin something, and are put together at random.
ODD = [
    b":", b"#", b"?", b"Ka", b"K", b"P", b"R", b"G", b"GET ", b"H", b"\x14", GOTO, b"E", b":GR#", b"\x06",
    b"\0", b"S", b"$",
]  # fmt: skip


@pytest.mark.parametrize(("sent", "end", "length", "protocol"), FIRST)
async def test_any_port_answers_a_program_in_its_protocol(sent: bytes, end: bytes, length: int, protocol: str) -> None:
    async with AnyBridge() as bridge:
        whole, slow, more = bridge.call("10.0.0.1"), bridge.call("10.0.0.2"), bridge.call("10.0.0.3")
        assert (answer := await whole.ask(sent)).endswith(end) and len(answer) == length
        await slow.dribble(sent, [0.05])
        await asyncio.sleep(1.0)
        assert slow.heard.endswith(end) and len(slow.heard) == length
        more.tell(sent + sent.lstrip(b"#?"))
        await asyncio.sleep(1.0)
        assert len(more.heard) == 2 * length
        assert bridge.recognised() == [protocol] * 3


@pytest.mark.parametrize("idle", [b"#", b"?", b"##", b"\r\n", b"\0", b" "])
async def test_any_port_decides_no_protocol_from_idle_bytes(idle: bytes) -> None:
    async with AnyBridge() as bridge:
        one, other = bridge.call("10.0.0.1"), bridge.call("10.0.0.2")
        for caller in (one, other):
            caller.tell(idle)
        await asyncio.sleep(10.0)
        one.tell(idle * 1000)
        assert len(one.guest.undelivered_bytes) <= 64, "however many come, few are kept"
        assert one.heard == b"" and bridge.recognised() == [] and len(bridge.any.hosts_present()) == 0
        assert len(await one.ask(b":GR#")) == 9
        assert len(await other.ask(b"e")) == 18
        assert bridge.recognised() == ["lx200", "nexstar"]


async def test_any_port_sends_positions_to_a_silent_client_until_its_first_byte() -> None:
    async with AnyBridge() as bridge:
        caller = bridge.call()
        await asyncio.sleep(2.9)
        assert caller.heard == b""
        await asyncio.sleep(2.0)
        assert len(caller.heard) in (72, 96) and caller.heard.startswith(b"\x18\0\0\0")
        assert bridge.recognised() == ["stellarium, because the program has sent nothing for 3 s"]
        told = len(caller.heard)
        assert len(await caller.ask(b":GR#")) == 9
        await asyncio.sleep(5.0)
        assert len(caller.heard) == told + 9, "no position is told any more"
        assert bridge.recognised()[1:] == ["lx200"]


@pytest.mark.parametrize("first", [b"#", b"P", b"H", b"R"])
async def test_any_port_stops_sending_positions_at_the_first_client_byte(first: bytes) -> None:
    async with AnyBridge() as bridge:
        caller = bridge.call()
        await asyncio.sleep(4.0)
        told = len(caller.heard)
        assert told
        caller.tell(first)
        await asyncio.sleep(0.9)
        assert len(caller.heard) == told
        await asyncio.sleep(5.0)
        assert len(await caller.ask(b"e")) == 18


async def test_stellarium_keeps_getting_positions_after_its_goto_on_any_port() -> None:
    async with AnyBridge() as bridge:
        silent, hasty = bridge.call("10.0.0.1"), bridge.call("10.0.0.2")
        hasty.tell(GOTO)
        await asyncio.sleep(3.0)
        assert hasty.heard.startswith(b"\x18\0\0\0") and bridge.sim.slewing
        await asyncio.sleep(2.0)
        silent.tell(GOTO[:1])
        for byte in GOTO[1:]:
            silent.tell(bytes((byte,)))
        told = len(silent.heard)
        await asyncio.sleep(2.1)
        assert len(silent.heard) >= told + 96 and bridge.recognised()[1:] == [
            "stellarium, because the program has sent nothing for 3 s"
        ]


async def test_stellarium_mobile_may_begin_with_an_echo_on_any_port() -> None:
    async with AnyBridge() as bridge:
        meade, celestron, at_once = bridge.call("10.0.0.1"), bridge.call("10.0.0.2"), bridge.call("10.0.0.3")
        assert await meade.ask(b"Ka") == b"a#"
        assert await celestron.ask(b"Ka") == b"a#"
        await asyncio.sleep(1.5)
        assert len(await meade.ask(b":GR#")) == 9
        assert len(await celestron.ask(b"e")) == 18
        at_once.tell(b"Ka:GR#")
        await asyncio.sleep(1.0)
        assert at_once.heard.startswith(b"a#") and len(at_once.heard) == 11
        assert bridge.recognised() == ["nexstar", "nexstar", "lx200", "nexstar", "lx200"]
        assert sorted(bridge.any.hosts_present()) == ["10.0.0.1", "10.0.0.2", "10.0.0.3"]


async def test_any_port_recognises_stellarium_mobile_by_its_whole_opening() -> None:
    """It counts in J2000; a program that says the same without the echo does not."""
    async with AnyBridge() as bridge:
        exact_sky.load(bridge.controller.astrometry.sky)
        mobile, other = bridge.call("10.0.0.1"), bridge.call("10.0.0.2")
        for caller, said in ((mobile, [b"Ka", b"##", b"#\x06"]), (other, [b"##", b"#\x06"])):
            for words in said:
                await caller.ask(words, 0.9)
        assert (mobile.heard, other.heard) == (b"a#A", b"A")
        assert await mobile.ask(b":GR#") != await other.ask(b":GR#")
        assert [one.program_name for one in bridge.any.connections()].count("Stellarium Mobile PLUS") == 1


async def test_any_port_forgets_half_a_command_that_is_not_continued() -> None:
    """As on a surface of its own protocol: the digits of a goto whose letter came long ago move nothing."""
    async with AnyBridge() as bridge:
        caller = bridge.call()
        caller.tell(b"R")
        await asyncio.sleep(1.5)
        caller.tell(b"34AB,12CE")
        await asyncio.sleep(3.0)
        assert not bridge.sim.slewing
        assert [entry.data for entry in bridge.entries if entry.arrow == "x"][:1] == [b"R"]


async def test_any_port_logs_bytes_of_no_protocol() -> None:
    async with AnyBridge() as bridge:
        caller = bridge.call()
        caller.tell(b"XYZ")
        await asyncio.sleep(1.0)
        assert len(told := bridge.recognised()) == 1 and told[0].startswith("lx200, because no protocol")
        assert bridge.warned == []


async def test_any_port_disconnects_a_port_scanner() -> None:
    async with AnyBridge() as bridge:
        for sent in (b"\x16\x03\x01\x02\0\x01", b"SSH-2.0-x\r\n", b"EHLO x\r\n", b"USER x\r\n", b"SETUP x RTSP/1.0"):
            caller = bridge.call()
            caller.tell(sent)
            await asyncio.sleep(0.1)
            assert caller.gone, sent
        notes = [entry.note for entry in bridge.entries if entry.arrow == "!" and "sends" in entry.note]
        assert len(notes) == 5 and all("LX200, NexStar, Stellarium" in note for note in notes)
        assert len(bridge.any.hosts_present()) == 0


async def test_read_only_any_port_lets_no_protocol_move_the_mount() -> None:
    async with AnyBridge(keys={"read_only": True}) as bridge:
        for sent in (b":Mn#", GOTO, b"P\x02\x10\x24\x05\0\0\0", b"r34AB0500,12CE0500"):
            bridge.call().tell(sent)
        await asyncio.sleep(3.0)
        assert not bridge.sim.slewing and not [one for one in bridge.sent_requests() if one[:1] in (b"r", b"R")]


async def test_pushed_positions_do_not_keep_an_arrow_alive() -> None:
    """Who only listens says nothing: the arrow of another connection of the same computer ends without that one."""
    async with AnyBridge(config={"dead_man": 6.0}) as bridge:
        caller, listener = bridge.call(), bridge.call()
        caller.tell(b":RS#:Mn#")
        await asyncio.sleep(4.0)
        assert bridge.controller.wanted.axes_moved_by_hand and listener.heard
        await asyncio.sleep(4.0)
        assert not bridge.controller.wanted.axes_moved_by_hand


async def test_any_port_closes_a_connection_of_undecided_protocol() -> None:
    async with AnyBridge() as bridge:
        for sent in (b"", b"#", b"P"):
            caller = bridge.call()
            if sent:
                caller.tell(sent)
            caller.guest.peer_closed()
            assert caller.guest.all_answered
            caller.guest.close()
        await asyncio.sleep(10.0)
        assert [entry.arrow for entry in bridge.entries if entry.arrow in "+-~"] == ["+", "-"] * 3


@given(
    pieces=st.lists(st.one_of(st.binary(min_size=1, max_size=30), st.sampled_from(ODD)), min_size=1, max_size=12),
    pauses=st.lists(st.sampled_from([0.0, 0.05, 1.2, 3.5]), min_size=12, max_size=12),
)
@settings(max_examples=as_a_rule(15, whole=30))
def test_any_port_keeps_memory_bounded_for_random_bytes(pieces: list[bytes], pauses: list[float]) -> None:
    async def program(bridge: AnyBridge) -> None:
        caller = bridge.call()
        for piece, pause in zip(pieces, pauses, strict=False):
            caller.tell(piece)
            assert caller.gone or len(caller.guest.undelivered_bytes) < 200
            await asyncio.sleep(pause)
        other = bridge.call("10.0.0.9")
        assert len(await other.ask(b":GVP#")) == 9
        if not caller.gone:
            caller.guest.close()
        told = [entry.arrow for entry in bridge.entries if entry.side.startswith("127") and entry.arrow in "+-"]
        assert told == ["+", "-"]

    async def whole() -> None:
        async with AnyBridge() as bridge:
            await program(bridge)

    run(whole())
