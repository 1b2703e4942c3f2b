"""The line to the mount: one exchange at a time, stop first, and no answer that belongs to an earlier question."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from gateway.core.errors import NoAnswer, NoDevice, Silence
from gateway.core.wire_log import WireLog
from gateway.mount.link.line import MountLink
from gateway.mount.link.queue import MOTION, POSITION, READ, SETTING, STOP
from gateway.protocols.base.driver import Send
from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
from gateway.protocols.nexstar.reply_rules import NexStarReplyRules
from gateway.transport.wires import OnData, OnLost
from tests.support.each import each


class Wire:
    """A wire whose other end is a function: request -> list of (seconds later, bytes)."""

    name = "test"

    def __init__(self, answers: Callable[[bytes], list[tuple[float, bytes]]]) -> None:
        self.answers = answers
        self.sent: list[bytes] = []
        self.opened = 0
        self.fail_to_open = 0
        self.on_data: OnData | None = None
        self.on_lost: OnLost | None = None

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        if self.fail_to_open:
            self.fail_to_open -= 1
            raise OSError(2, "no such port")
        self.opened += 1
        self.on_data, self.on_lost = on_data, on_lost

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        for delay, answer in self.answers(data):
            asyncio.get_running_loop().call_later(delay, self.deliver, answer)

    def deliver(self, answer: bytes) -> None:
        assert self.on_data is not None
        self.on_data(answer)

    async def close(self) -> None:
        pass


def hand_control(data: bytes) -> list[tuple[float, bytes]]:
    """Answers at once, as a sane hand control."""
    replies = {b"J": b"\x01#", b"t": b"\x02#", b"V": b"\x04\x15#", b"L": b"0#", b"M": b"#"}
    if data[:1] == b"K":
        return [(0.01, data[1:2] + b"#")]
    return [(0.01, replies.get(data, b"#"))]


async def opened(answers: Callable[[bytes], list[tuple[float, bytes]]]) -> tuple[MountLink, Wire]:
    wire = Wire(answers)
    line = MountLink(wire, NexStarReplyRules(), WireLog(lambda: 0.0))
    line.start()
    await asyncio.sleep(0.01)
    return line, wire


async def test_request_made_before_the_port_is_open_is_answered() -> None:
    line = MountLink(Wire(hand_control), NexStarReplyRules(), WireLog(lambda: 0.0))
    line.start()
    assert await line.exchange(Send("J"))
    await line.close()


async def test_line_does_one_exchange_at_a_time_and_stops_first() -> None:
    line, wire = await opened(lambda data: [(0.2, hand_control(data)[0][1])])
    reads = [asyncio.ensure_future(line.exchange(Send("J"), READ)) for _ in range(3)]
    await asyncio.sleep(0.01)
    motion = asyncio.ensure_future(line.exchange(Send("V"), MOTION))
    await asyncio.sleep(0.05)
    assert wire.sent == [b"J"]
    stop = asyncio.ensure_future(line.exchange(Send("M"), STOP))
    await asyncio.gather(*reads, motion, stop)
    assert wire.sent == [b"J", b"M", b"V", b"J", b"J"]
    await line.close()


async def test_position_goes_before_other_reads_and_settings() -> None:
    """Its halves must be of one instant, and settings without end must not blind the hub."""
    line, wire = await opened(lambda data: [(0.2, hand_control(data)[0][1])])
    others = [
        asyncio.ensure_future(line.exchange(Send(name), priority))
        for name, priority in [("J", READ), ("J", READ), ("t", SETTING), ("t", SETTING), ("t", SETTING), ("t", SETTING)]
    ]
    await asyncio.sleep(0.7)
    await line.exchange(Send("V"), POSITION)
    await line.exchange(Send("V"), POSITION)
    await asyncio.gather(*others)
    assert wire.sent == [b"t", b"t", b"t", b"J", b"V", b"V", b"J", b"t"]
    await line.close()


@each("priorities", [(POSITION, READ), (MOTION, POSITION), (MOTION, MOTION)])
async def test_setting_is_sent_in_turn_under_any_load(priorities: tuple[int, ...]) -> None:
    """Two that ask without end, on a line that is slower than they are."""
    line, wire = await opened(lambda data: [(1.0, hand_control(data)[0][1])])

    async def ask_for_ever(priority: int) -> None:
        while True:
            await line.exchange(Send("V"), priority)

    others = [asyncio.create_task(ask_for_ever(priority)) for priority in priorities for _ in range(2)]
    await asyncio.sleep(0.1)
    async with asyncio.timeout(30.0):
        await asyncio.gather(*(line.exchange(Send("t"), SETTING) for _ in range(3)))
    turns = [n for n, frame in enumerate(wire.sent) if frame == b"t"]
    assert all(later - earlier > 2 for earlier, later in pairwise(turns))
    for task in others:
        task.cancel()
    await line.close()


async def test_reply_time_is_measured_though_a_stop_follows_at_once() -> None:
    """A stop of a Meade has no reply: it is over before whoever asked before it has read its answer."""
    wire = Wire(lambda data: [(0.25, b"12:00:00#")] if data == b":GR#" else [])
    line = MountLink(wire, Lx200ReplyRules(), WireLog(lambda: 0.0))
    line.start()
    await asyncio.sleep(0.01)
    slow = asyncio.ensure_future(line.timed_exchange(Send("GR"), POSITION))
    await asyncio.sleep(0.1)
    stop = asyncio.ensure_future(line.exchange(Send("Q"), STOP))
    values, took = await slow
    assert values["ra"] == 180.0
    assert took == pytest.approx(0.25, abs=0.01)
    await stop
    await line.close()


async def test_late_mount_answer_is_never_taken_for_the_next_reply() -> None:
    """``J`` is answered after 4 s: too late. Echoes follow until the line is in step, then the next command."""

    def answers(data: bytes) -> list[tuple[float, bytes]]:
        return [(4.0, b"\x01#")] if data == b"J" else hand_control(data)

    line, wire = await opened(answers)
    with pytest.raises(NoAnswer):
        await line.exchange(Send("J"))
    value = await line.exchange(Send("t"))
    assert value["mode"] == 2
    echoes = [sent for sent in wire.sent if sent[:1] == b"K"]
    assert len(set(echoes)) >= 2
    assert wire.sent.index(b"t") > max(wire.sent.index(echo) for echo in echoes)
    await line.close()


async def test_silent_mount_is_reported_down_and_comes_back() -> None:
    alive = True

    def answers(data: bytes) -> list[tuple[float, bytes]]:
        return hand_control(data) if alive else []

    line, _ = await opened(answers)
    ups = []
    line.came_up.connect(lambda _: ups.append(True))
    alive = False
    with pytest.raises(NoAnswer):
        await line.exchange(Send("J"))
    await asyncio.sleep(15)
    assert line.state == "down"
    with pytest.raises(NoAnswer):  # at once, not after another timeout
        await asyncio.wait_for(line.exchange(Send("J")), 0.1)
    alive = True
    await asyncio.sleep(10)
    assert line.state == "up"
    assert ups == [True]
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()


async def test_lost_port_is_opened_again() -> None:
    line, wire = await opened(hand_control)
    assert wire.on_lost is not None
    wire.fail_to_open = 3
    wire.on_lost("unplugged")
    await asyncio.sleep(0.1)
    assert line.state == "down"
    await asyncio.sleep(10)
    assert line.state == "up"
    assert wire.opened == 2
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()


@each(
    ("ask", "reply", "expected"),
    [
        (Send("J"), b"\x01#", {"aligned": 1}),
        (Send("w"), b"\x23\x23\x23\x00\x76\x14\x23\x01#", None),
        (Send("V"), b"\x04\x23#", {"major": 4, "minor": 35}),
        (Send("t"), b"\x02\x00#", {"mode": 2}),  # a StarSense says more than one byte
        (Send("device_version", {"device": 18}), b"\x00\x00\x00#", NoDevice),
        (Send("gps_linked"), b"\x01#", {"linked": 1}),
        (Send("gps_linked"), b"\x00\x00#", NoDevice),
    ],
)
@each("way", ["whole", "byte by byte"])
async def test_nexstar_replies_are_delimited_by_length(ask: Send, reply: bytes, expected: Any, way: str) -> None:
    pieces = [reply] if way == "whole" else [bytes((byte,)) for byte in reply]
    line, _ = await opened(lambda data: [(0.01 * n, piece) for n, piece in enumerate(pieces)])
    if expected is NoDevice:
        with pytest.raises(NoDevice):
            await line.exchange(ask)
    else:
        values = await line.exchange(ask)
        if expected is None:
            assert values["latitude"] == pytest.approx(35 + 35 / 60 + 35 / 3600)
            assert values["longitude"] == pytest.approx(-(118 + 20 / 60 + 35 / 3600))
        else:
            assert values == expected
    await line.close()


async def test_unsolicited_bytes_are_dropped() -> None:
    line, wire = await opened(hand_control)
    wire.deliver(b"\x09#\x09#")
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()


async def test_unanswered_request_leaves_the_line_up_after_a_check() -> None:
    line, wire = await opened(lambda data: [] if data == b"v" else hand_control(data))
    with pytest.raises(Silence):
        await line.exchange(Send("v", timeout=1.0))
    assert (await line.exchange(Send("t")))["mode"] == 2
    assert wire.sent[0] == b"v"
    assert [sent[:1] for sent in wire.sent[1:]] == [b"K", b"K", b"t"]  # a late answer must not be taken for t's
    assert line.state == "up"
    await line.close()


async def test_garbled_reply_fails_only_its_own_request_on_the_mount_line() -> None:
    line, _ = await opened(lambda data: [(0.01, b"34AZ0500,12CE0500#")] if data == b"e" else hand_control(data))
    with pytest.raises(Exception, match="Garbled"):
        await line.exchange(Send("e"))
    assert (await line.exchange(Send("t")))["mode"] == 2
    await line.close()
