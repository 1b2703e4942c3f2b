"""The line to a telescope over HTTP, where no reply can be mistaken for another: a stop waits for no read."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from gateway.core.errors import NoAnswer, Silence
from gateway.core.wire_log import WireLog
from gateway.mount.link.line import MountLink
from gateway.mount.link.queue import STOP
from gateway.protocols.alpaca.driver.reply_rules import AlpacaReplyRules
from gateway.protocols.base.driver import Send
from gateway.transport.http_wire import HttpWire
from tests.support.each import each
from tests.unit.mount.link.test_queue import Wire


class HttpLike(Wire):
    newest_only = True


def alpaca(unanswered: bytes) -> Callable[[bytes], list[tuple[float, bytes]]]:
    return lambda data: [] if data.startswith(unanswered) else [(0.02, b"true\n" if b"get" in data else b"null\n")]


async def opened(answers: Callable[[bytes], list[tuple[float, bytes]]]) -> tuple[MountLink, Wire]:
    wire = HttpLike(answers)
    line = MountLink(wire, AlpacaReplyRules(), WireLog(lambda: 0.0))
    line.start()
    await asyncio.sleep(0.01)
    return line, wire


async def stopped_after(line: MountLink, wire: Wire, seconds: float, before: Send) -> float:
    """Send a request, and a stop so many seconds later; return after how many seconds that was answered."""
    reading = asyncio.ensure_future(line.exchange(before))
    await asyncio.sleep(seconds)
    began, wire.answers = asyncio.get_running_loop().time(), alpaca(b"nothing")
    await line.exchange(Send("moveaxis", {"axis": 0, "rate": 0.0}, timeout=1.5), STOP)
    took = asyncio.get_running_loop().time() - began
    with contextlib.suppress(NoAnswer, Silence):
        await reading
    assert line.state == "up"
    return took


@each("seconds", [0.5, 4.9, 5.1, 5.5])
async def test_alpaca_stop_does_not_wait_for_an_unanswered_read(seconds: float) -> None:
    """Its late reply cannot be mistaken for another one."""
    assert HttpWire.newest_only
    line, wire = await opened(alpaca(b"get"))
    assert await stopped_after(line, wire, seconds, Send("devicestate")) < 0.25
    assert (await line.exchange(Send("connected")))["value"] is True
    await line.close()


async def test_alpaca_stop_is_sent_at_once_after_an_unanswered_command() -> None:
    line, wire = await opened(alpaca(b""))
    assert await stopped_after(line, wire, 1.8, Send("abortslew", timeout=1.5)) < 0.25
    await line.close()
