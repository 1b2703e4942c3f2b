"""Replies of genuine and home-made telescopes that differ by a line end, a blank or a code are understood, or refuse.

The bytes are typed by hand: Arduino sketches answer with ``println``, the classic's manual has codes beyond 2 for
``:MS#``, and some controllers do not answer ``:CM#``.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from gateway.core.errors import Fault, Garbled
from gateway.diagnostics.detect.ports import SerialPortInfo, parse_port
from gateway.diagnostics.detect.scan_port import scan_port
from gateway.diagnostics.virtual_time import run
from gateway.protocols.base.driver import Send
from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
from tests.integration.lx200.test_odd_meades import found, hours, oddly
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.uart import UartWire

DEVICES = ["lx200", "autostar", "lx200gps", "onstep", "teenastro"]
#: What a device sends around each of its replies.
AROUND = [(b"", b"\r\n"), (b"\r\n", b""), (b"\n\r", b" \r\n"), (b" ", b" "), (b"\t", b"\0")]


def padded(bridge: Bridge, around: tuple[bytes, bytes], apart: bool) -> None:
    """Have the mount send this around its replies, what comes behind with them or in a packet of its own."""
    wire: Any = bridge.controller.line.wire
    feed: Callable[[bytes], bytes] = wire.feed
    before, behind = around

    def padding(data: bytes) -> bytes:
        if not (answer := feed(data)):
            return b""
        if apart:
            asyncio.get_running_loop().call_later(0.08, wire.deliver, behind)
        return before + answer + (b"" if apart else behind)

    wire.feed = padding


@pytest.mark.parametrize("model", DEVICES)
@pytest.mark.parametrize("around", AROUND)
@pytest.mark.parametrize("apart", [False, True])
async def test_meade_driver_ignores_line_ends_and_blanks_around_replies(
    model: str, around: tuple[bytes, bytes], apart: bool
) -> None:
    bridge = Bridge(model, driven="lx200", surface="autostar", config={"sun": 0.0, "lowest": -90.0}, speed=10.0)
    padded(bridge, around, apart)
    await found(bridge)
    assert bridge.driver.model == model
    client = bridge.client()
    assert 15.0 * hours(await client.ask(b":GR#", 3.5)) == pytest.approx(bridge.sim.position()[0], abs=0.01)
    assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", 3.5, ending=b"0") == b"110"
    await asyncio.sleep(30.0)
    assert (await client.ask(b":GR#", 3.5)).startswith(b"07:00:00")
    assert b"#" in await client.ask(b":CM#", 4.0)
    assert not [entry for entry in bridge.entries if "garbled" in entry.note or "does not answer" in entry.note]
    await bridge.controller.close()


@each("url", ["-", "lx200@/dev/ttyUSB0", "lx200:other@/dev/ttyUSB0", "lx200:autostar@/dev/ttyUSB0"])
async def test_home_made_telescope_is_detected(url: str) -> None:
    """It knows the position alone, and ends each line."""

    def device(data: bytes) -> bytes:
        lines = {b":GR": b"03:00:00", b":GD": b"+45*00:00", b"\x06": b"P"}
        return b"".join(
            lines[part] + b"#\r\n" if part != b"\x06" else b"P\r\n" for part in data.split(b"#") if part in lines
        )

    place = SerialPortInfo("-", "-") if url == "-" else parse_port(url)
    finding = await scan_port(place, UartWire(device))
    assert finding.state == "lx200", finding
    assert finding.mount is not None, finding


@each(("command", "reply", "says"), [
    ("MS", b"4Object above limit.#", "Object above limit."),
    ("MS", b"4Object above limit.#\r\n", "Object above limit."),
    ("MS", b"3 Limit#", "Limit"),
    ("MS", b"1", "horizon"),
    ("MS", b"6\r\n", "Refused"),
    ("MA", b"1Object Below Horizon.#", "Object Below Horizon."),
    ("MA", b"5Slewing already#", "Slewing already"),
    ("Sd", b"0Out of range#", "Out of range"),
])  # fmt: skip
def test_meade_driver_takes_a_digit_with_text_as_a_refusal_with_that_text(
    command: str, reply: bytes, says: str
) -> None:
    taken = Lx200ReplyRules("lx200gps").parse_reply(Send(command), reply)
    assert taken is not None and taken[1] == len(reply)
    assert isinstance(taken[0], Fault) and not isinstance(taken[0], Garbled)
    assert says.lower() in f"{taken[0]} {type(taken[0]).__name__}".lower()


@each(("command", "reply", "value"), [
    ("GD", b"-12\xc2\xb030:45#", {"dec": pytest.approx(-12.5125)}),
    ("GD", b"+12\xc2\xb030#", {"dec": pytest.approx(12.5)}),
    ("GZ", b"123\xc2\xb030:00#", {"az": pytest.approx(123.5)}),
    ("GR", b"06:21:28.40#", {"ra": pytest.approx(95.36833)}),
    ("GD", b"-12*30:45.0#", {"dec": pytest.approx(-12.5125)}),
])  # fmt: skip
def test_meade_driver_reads_utf_8_degree_signs_and_decimals(command: str, reply: bytes, value: Any) -> None:
    taken = Lx200ReplyRules("lx200gps").parse_reply(Send(command), reply)
    assert taken is not None and taken[1] == len(reply)
    assert isinstance(taken[0], dict) and {**taken[0], **value} == taken[0], taken


@each(("command", "reply"), [
    ("GD", b"12*30:45#"),
    ("GD", b" 12*30:45#"),
    ("GD", b"+12\xc230:4#"),
    ("GR", b"6:21:28#"),
    ("GR", b"06:21:28.#"),
    ("MS", b"0Object#"),
    ("MS", b"+45*00:00#"),
    ("MA", b"1AT1#"),
    ("Sr", b"0Autostar#"),
    ("Sr", b"04.2g#"),
    ("GR", b"4Object above limit.#"),
    ("GR", b"4"),
    ("GR", b"03:0 0:00#"),
    ("GR", b"03:00:00#\r\n+45*00:00#"),
])  # fmt: skip
def test_meade_driver_rejects_bytes_that_are_no_reply(command: str, reply: bytes) -> None:
    taken = Lx200ReplyRules("lx200gps").parse_reply(Send(command), reply)
    assert taken is None or isinstance(taken[0], Garbled) or taken[1] < len(reply)


async def test_program_reads_the_text_of_a_refusal_unknown_to_the_tables() -> None:
    bridge = Bridge("lx200", driven="lx200", surface="lx200", config={"sun": 0.0})
    oddly(bridge, b":MS#", b"4Object above limit.#")
    async with bridge:
        told = await bridge.client().ask(b":Sr07:00:00#:Sd+30*00:00#:MS#", 3.5, ending=b".#")
        assert b"Object above limit." in told
        assert bridge.controller.line.state == "up"


@pytest.mark.parametrize("answer", [b"", b"1", b"0#"])
@pytest.mark.parametrize("model", ["lx200", "autostar"])
@pytest.mark.parametrize("takes", [True, False])
def test_sync_without_a_text_is_confirmed_by_the_position(answer: bytes, model: str, takes: bool) -> None:
    async def night() -> None:
        bridge = Bridge(model, driven="lx200", surface=model, config={"sun": 0.0})
        wire: Any = bridge.controller.line.wire
        feed: Callable[[bytes], bytes] = wire.feed

        def quiet(data: bytes) -> bytes:
            if data != b":CM#":
                return feed(data)
            if takes:
                feed(data)
            return answer

        async with bridge:
            wire.feed = quiet
            ra, dec = bridge.sim.position()
            client = bridge.client()
            minutes = round(ra / 15.0 * 60.0 + 4.0) % 1440
            await client.ask(
                f":Sr{minutes // 60:02}:{minutes % 60:02}:00#:Sd{int(dec):+03}*00:00#".encode(), ending=b"11"
            )
            told = await client.ask(b":CM#", 6.0)
            assert (len(told) > 1) is takes, told
            assert told.endswith(b"#")

    run(night())
