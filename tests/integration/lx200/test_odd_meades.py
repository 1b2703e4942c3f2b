"""Meades that answer oddly, or not at all, what they need not answer: they can do less, and none is refused.

One question at a time gets another answer than the manual's, or none; where the mount points is answered as ever. The
bytes are those that real telescopes and programs that play one were seen to send, typed by hand.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.protocols.lx200.driver.pointing import STILL_PERIOD
from gateway.transport.handler import NewConnection
from tests.support.in_process_gateway import Bridge

NAK = b"\x15"
STATES = [b"LN1#", b"PT4#", b"18:00:00#", NAK, b"", b"#", b"AT", b"XT1#", b"GT2", b"0", b"1#", b"AN0#", b"PTH#"]
LETTERS = [b"G", b"D", b"1", b"A#", b"", b"P#", NAK, b"#", b"?", b"AP", b"L", b"0#"]
NAMES = [
    b"", b"#", b"LX200 Classic#", b"LX200GPS#", b"LX2001#", b"Autostar", NAK, b"On-Step#", b"1", b"0#", b"\xff\xfe#",
    b"a name that is far longer than any name of a telescope ever was, with a lot in it#",
]  # fmt: skip
FIRMWARE = [b"", b"#", b"4.2g#", NAK, b"1", b"0#"]
HOME = [b"", b"#", b"9", b"0", NAK, b"1#"]
VARIANTS = [
    *(("autostar", "GW", b":GW#", answer) for answer in STATES),
    *(("autostar", "ACK", b"\x06", a) for a in LETTERS),
    *(("lx200", "ACK", b"\x06", answer) for answer in LETTERS),
    *(("autostar", "GVP", b":GVP#", a) for a in NAMES),
    *(("lx200", "GVP", b":GVP#", answer) for answer in NAMES),
    *(("autostar", "GVN", b":GVN#", a) for a in FIRMWARE),
    *(("lx200", "h?", b":h?#", answer) for answer in HOME),
    ("lx200gps", "GW", b":GW#", NAK),
    ("lx200-16", "h?", b":h?#", b""),
]


def oddly(bridge: Bridge, question: bytes, answer: bytes) -> None:
    """Have the simulated mount answer this to that question."""
    wire: Any = bridge.controller.line.wire
    feed: Callable[[bytes], bytes] = wire.feed
    wire.feed = lambda data: answer if data == question else feed(data)


def hours(told: bytes) -> float:
    """``HH:MM:SS#`` -> hours."""
    whole, minutes, seconds = told[:-1].split(b":")
    return int(whole) + int(minutes) / 60.0 + int(seconds) / 3600.0


async def found(bridge: Bridge, seconds: float = 20.0) -> None:
    bridge.controller.start()
    async with asyncio.timeout(seconds):
        await bridge.controller.site_read.wait()


@pytest.mark.sampled(1, every=3)
@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize(("model", "name", "question", "answer"), VARIANTS)
async def test_device_that_only_tells_its_position_counts_as_a_mount(
    model: str, name: str, question: bytes, answer: bytes, named: bool
) -> None:
    bridge = Bridge(model, driven="lx200", surface="autostar", named=named, config={"sun": 0.0}, speed=10.0)
    oddly(bridge, question, answer)
    await found(bridge)
    client = bridge.client()
    told = await client.ask(b":GR#", 3.5)
    assert 15.0 * hours(told) == pytest.approx(bridge.sim.position()[0], abs=0.01)
    assert len(await client.ask(b":GW#", 3.5)) == 3
    await asyncio.sleep(6.0)  # what was answered oddly may still be answered
    assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", 3.5, ending=b"0") == b"110"
    await asyncio.sleep(6.0)
    assert (await client.ask(b":GR#", 3.5)).startswith(b"07:00:00")
    assert bridge.sim.position()[1] == pytest.approx(30.0, abs=0.01)
    assert bridge.controller.line.state == "up"
    await bridge.controller.close()


@pytest.mark.parametrize(
    ("model", "question", "answer", "expected"),
    [
        ("autostar", b":GW#", b"LN1#", (op.Tracking.OFF, True, False)),
        ("autostar", b":GW#", b"PT4#", (op.Tracking.EQ_NORTH, True, True)),
        ("autostar", b":GW#", b"GT1", (op.Tracking.EQ_NORTH, True, True)),
        ("autostar", b":GW#", b"AN0#", (op.Tracking.OFF, False, False)),
        ("autostar", b":GW#", b"18:00:00#", (op.Tracking.ALTAZ, True, False)),
        ("lx200gps", b":GW#", b"\x15", (op.Tracking.ALTAZ, True, False)),
        ("lx200", b"\x06", b"G", (op.Tracking.EQ_NORTH, True, True)),
        ("lx200", b"\x06", b"L", (op.Tracking.OFF, True, False)),
        ("lx200", b"\x06", b"A#", (op.Tracking.ALTAZ, True, False)),
        ("lx200", b"\x06", b"D", (op.Tracking.ALTAZ, True, False)),
    ],
)
async def test_odd_meade_offers_only_the_abilities_that_its_answers_show(
    model: str, question: bytes, answer: bytes, expected: tuple[op.Tracking, bool, bool]
) -> None:
    bridge = Bridge(model, driven="lx200", surface="autostar")
    oddly(bridge, question, answer)
    await found(bridge)
    status = await bridge.controller.read(op.GetStatus())
    assert (status.tracking, status.aligned, status.equatorial) == expected
    assert bridge.driver.model == model
    await bridge.controller.close()


@pytest.mark.parametrize("pushed", [True, False])
@pytest.mark.parametrize("model", ["autostar", "lx200"])
async def test_constant_distance_bars_do_not_report_endless_slewing(model: str, pushed: bool) -> None:
    """A device on a telescope that is pushed by hand answers so; its position shows that it stands."""
    bridge = Bridge(model, driven="lx200", surface="autostar", config={"sun": 0.0}, speed=1.0 if pushed else 0.2)
    oddly(bridge, b":D#", b"\x7f#")
    if pushed:
        oddly(bridge, b":MS#", b"0")
    await found(bridge)
    client = bridge.client()
    assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", 3.5, ending=b"0") == b"110"
    for _ in range(6):
        await asyncio.sleep(2.0)
        assert len(await client.ask(b":D#")) > 1, "a goto may take its time to begin"
    while not pushed and bridge.sim.mechanics.slewing(bridge.sim.now):
        assert len(await client.ask(b":D#")) > 1 and bridge.driver.goto is not None
        await asyncio.sleep(1.0)
    await asyncio.sleep(2.0 * STILL_PERIOD)
    assert await client.ask(b":D#") == b"#"
    assert not bridge.controller.moving
    await bridge.controller.close()


@pytest.mark.parametrize(
    ("answer", "model"),
    [
        (b"LX200 Classic#", "lx200"),
        (b"LX200GPS#", "lx200gps"),
        (b"LX2001#", "lx200gps"),
        (b"", "lx200"),
        (b"#", "lx200"),
        (b"LX200 16#", "lx200-16"),
        (b"Autostar#", "autostar"),
    ],
)
async def test_meade_model_follows_from_the_reported_name(answer: bytes, model: str) -> None:
    bridge = Bridge("lx200", driven="lx200", surface="autostar")
    oddly(bridge, b":GVP#", answer)
    await found(bridge)
    assert bridge.driver.model == model
    await bridge.controller.close()


def test_device_that_swallows_the_command_after_ack_is_still_detected() -> None:
    """For such a server ACK and what comes behind it, up to the ``#``, are one command that it does not know."""

    async def program() -> None:
        bridge = Bridge("lx200", driven="lx200", surface="autostar")
        wire: Any = bridge.controller.line.wire
        feed, half = wire.feed, b""

        def whole(data: bytes) -> bytes:
            nonlocal half
            *lines, half = (half + data).split(b"#")
            return b"".join(feed(line + b"#") if line.startswith(b":") else b"" for line in lines)

        wire.feed = whole
        began = bridge.clock()
        await found(bridge, 6.0)
        assert not [entry for entry in bridge.entries if "does not answer" in entry.note]
        assert b"\x06" in bridge.sent_requests()
        assert bridge.sent_requests().count(b"\x06") == 1  # its silence is remembered
        assert bridge.clock() - began < 6.0
        await bridge.controller.close()

    run(program())


@pytest.mark.parametrize("presented", ["lx200", "lx200-16", "autostar", "lx200gps"])
def test_gateway_drives_the_lx200_surface_of_another_gateway(presented: str) -> None:
    async def program() -> None:
        inner = Bridge("6-8se", driven="nexstar", surface=presented)
        async with inner:
            outer = Bridge("lx200", driven="lx200", surface="autostar")
            guest = inner.acceptor.accept(NewConnection("10.0.0.3", "10.0.0.3", lambda data: wire.deliver(data)))
            wire: Any = outer.controller.line.wire

            def feed(data: bytes) -> bytes:
                asyncio.get_running_loop().call_later(0.01, guest.feed, data)
                return b""

            wire.feed = feed
            await found(outer, 10.0)
            assert outer.driver.model == presented
            client = outer.client()
            heard = await client.ask(b":GR#", 3.5)
            assert heard == await inner.client().ask(b":GR#", 3.5)
            await outer.controller.close()

    run(program())


def test_meade_keeps_its_model_name_after_lost_answers() -> None:
    """Two lost answers in a row do not make an Autostar, which has told its name before, an LX200 16 inch."""

    async def program() -> None:
        async with Bridge("autostar", driven="lx200", presented="nexstar", surface=None) as bridge:
            wire: Any = bridge.controller.line.wire
            feed, lost = wire.feed, [b":GVP#", b":GVP#"]

            def lossy(data: bytes) -> bytes:
                answer = bytes(feed(data))
                if data in lost:
                    lost.remove(data)
                    return b""
                return answer

            wire.feed = lossy
            await bridge.controller.identification.read_once(op.GetIdentity())
            identity = bridge.controller.cache.last_value(op.GetIdentity)
            assert (identity.product, identity.model, lost) == ("Autostar", "autostar", [])

    run(program())
