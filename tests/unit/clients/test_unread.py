"""The text of a refusal waits on the network until the program asks anew, and nothing else waits for it."""

from __future__ import annotations

import asyncio
from typing import Any

from msgspec.structs import replace

from gateway.app.bindings import profiles_of
from gateway.app.config import SurfaceConfig
from gateway.app.config.programs import text_delay
from gateway.clients.commands.unread import HOLD_TIME
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon
from gateway.transport.handler import NewConnection
from tests.support.fake_gateway import FakeGateway

TARGET, GOTO, TEXT = b":Sr20:00:00#:Sd-30*00:00#", b":MS#", b"Object Below Horizon.#"
INDI = b"\x06:GR#\x06:Gc#"


class Line:
    """One connection of a program, over the network or not."""

    def __init__(self, model: str = "autostar", client: str = "auto", network: bool = True) -> None:
        self.gateway = FakeGateway(model=model)
        self.gateway.mount.faults[op.Goto] = BelowHorizon()
        surface = SurfaceConfig(at="lx200@tcp://127.0.0.1:0", client=client)
        known: Any = None
        self.gateway.acceptor.binding = replace(
            self.gateway.acceptor.binding,
            profiles=tuple(profiles_of("lx200", surface, known)),
            hold_time=text_delay(surface, "lx200", client),
        )
        self._heard = b""
        hang_up = (lambda last: None) if network else None
        self.guest = self.gateway.acceptor.accept(NewConnection("192.168.4.2:1", "192.168.4.2", self._hear, hang_up))

    def _hear(self, data: bytes) -> int:
        self._heard += data
        return 0

    async def after(self, seconds: float = 0.01) -> bytes:
        """What has come until so many seconds from now."""
        await asyncio.sleep(seconds)
        heard, self._heard = self._heard, b""
        return heard

    async def ask(self, data: bytes, seconds: float = 0.01) -> bytes:
        self.guest.feed(data)
        return await self.after(seconds)

    async def refused(self, opening: bytes = b"") -> bytes:
        """Begin as a program does, and have a goto refused; what came for it at once."""
        for piece in (opening, TARGET):
            await self.ask(piece)
        return await self.ask(GOTO)


async def test_refusal_text_is_dropped_if_the_program_sends_another_request() -> None:
    line = Line()
    assert await line.refused() == b"1"
    assert await line.ask(b":GR#") == b"12:34:56#"
    assert await line.after(10.0) == b""


async def test_refusal_text_is_sent_to_a_program_that_waits() -> None:
    line = Line()
    assert await line.refused() == b"1"
    assert await line.after(HOLD_TIME - 0.1) == b""
    assert await line.after(0.2) == TEXT
    assert await line.ask(b":GR#") == b"12:34:56#"


async def test_bytes_that_request_nothing_do_not_drop_the_refusal_text() -> None:
    line = Line()
    await line.refused()
    assert await line.ask(b"\r\n", HOLD_TIME + 0.1) == TEXT


async def test_stop_is_answered_at_once_and_drops_the_refusal_text() -> None:
    line = Line()
    await line.refused()
    stops = line.gateway.controller.stop_count
    line.guest.feed(b":Q#")
    assert line.gateway.controller.stop_count == stops + 1
    assert await line.after(10.0) == b""


async def test_refusal_text_splits_no_reply_to_commands_sent_together() -> None:
    line = Line()
    assert await line.ask(TARGET + GOTO + b":GR#") == b"111" + TEXT + b"12:34:56#"


async def test_program_known_not_to_read_refusal_texts_never_gets_one() -> None:
    line = Line()
    assert await line.refused(INDI) == b"1"
    assert await line.after(60.0) == b""
    assert await line.ask(b":GR#") == b"12:34:56#"
    line = Line(client="indi")
    assert await line.refused() == b"1"
    assert await line.after(60.0) == b""


async def test_program_known_to_read_refusal_texts_gets_them_at_once() -> None:
    whole = b"1" + TEXT
    assert await Line(network=False).refused() == whole
    assert await Line(client="rts2").refused() == whole
    assert await Line().refused(b"#:GR#") == whole
    assert await Line().refused(b"#\x06") == whole


async def test_pending_refusal_text_is_sent_when_the_connection_ends() -> None:
    """A program that only closes its sending half still reads."""
    line = Line()
    await line.refused()
    line.guest.peer_closed()
    assert await line.after() == TEXT
    line = Line()
    await line.ask(TARGET)
    line.guest.feed(GOTO)
    line.guest.peer_closed()
    assert await line.after() == b"1" + TEXT
    line = Line()
    await line.refused()
    line.guest.close()
    assert await line.after(10.0) == b""


async def test_unread_reply_to_a_meade_restart_shifts_no_later_reply() -> None:
    """:I# of an LX200GPS: one program waits for its X, another goes on at once."""
    line = Line("lx200gps")
    assert await line.ask(b":I#", HOLD_TIME + 0.1) == b"X"
    assert await line.ask(b":I#") == b""
    assert await line.ask(b":GR#") == b"12:34:56#"
    line.guest.feed(b":I#")
    line.guest.feed(b":GR#")
    assert await line.after(10.0) == b"12:34:56#"
    assert await line.ask(b"#:I#") == b"X"
