"""Every recorded program with all its gotos refused, over the network: none reads less than if the text came at once.

Each reads the way that its source shows. INDI's drivers, which leave the text unread and cannot discard it on a socket,
must read the same as on a pseudo-terminal, where they can.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, cast

from msgspec.structs import replace

from gateway.app.bindings import profiles_of
from gateway.app.config import SurfaceConfig
from gateway.app.config.programs import text_delay
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon
from gateway.diagnostics.virtual_time import run
from gateway.transport.handler import NewConnection
from tests.conformance.test_lx200_transcripts import FILES, _set_up, _settings
from tests.support.each import each
from tests.support.fake_gateway import FakeGateway
from tests.support.transcript_files import Line, read

REFUSAL = b"1Object Below Horizon.#"


class Reads(NamedTuple):
    """How a program reads a refusal: for how many seconds it waits for the bytes behind the digit (0: not at all).

    ``discards``: it throws away what has come before it asks anew.
    """

    rest: float
    discards: bool


HOW = {
    "ascom": Reads(5.0, True),
    "cartes-du-ciel": Reads(1.0, True),
    "indi-autostar": Reads(0.0, False),
    "indi-autostar-low": Reads(0.0, False),
    "indi-basic": Reads(0.0, False),
    "indigo": Reads(0.0, True),
    "skysafari": Reads(0.0, True),
    "sscore": Reads(0.0, True),
    "stellarium": Reads(3.0, False),
    "stellarium-mobile": Reads(3.0, False),
}
#: Hamlib is not among them: it needs a serial port, and never sends :MS#.
PROGRAMS = [path for path in FILES if path.stem != "lx200-hamlib"]
#: Seconds between a refusal and the next question. INDI's drivers wait one second at most, in their default settings.
PAUSES = (0.0, 0.5, 1.0)
PATIENCE = 3.0


class Program:
    """One program on its connections; what has come and was not read is in ``unread``."""

    def __init__(self, gateway: FakeGateway, how: Reads, network: bool) -> None:
        self._gateway, self._how, self._network = gateway, how, network
        self.unread = b""
        self.connect()

    def connect(self) -> None:
        hang_up = (lambda last: None) if self._network else None
        self._guest = self._gateway.acceptor.accept(NewConnection("192.168.4.2:1", "192.168.4.2", self._hear, hang_up))

    def reconnect(self) -> None:
        self._guest.close()
        self.unread = b""
        self.connect()

    def _hear(self, data: bytes) -> int:
        self.unread += data
        return 0

    async def ask(self, packet: bytes, expected: bytes) -> bytes:
        """Send a packet and return what the program reads, whose length it knows from the command."""
        if self._how.discards:
            self.unread = b""
        self._guest.feed(packet)
        if expected != REFUSAL:
            return await self._take(len(expected))
        heard = await self._take(1)
        if self._how.rest:
            deadline = asyncio.get_running_loop().time() + self._how.rest
            while heard[-1:] != b"#" and asyncio.get_running_loop().time() < deadline:
                heard += await self._take(1, deadline - asyncio.get_running_loop().time())
        return heard

    async def _take(self, count: int, seconds: float = PATIENCE) -> bytes:
        waited = 0.0
        while len(self.unread) < count and waited < seconds:
            await asyncio.sleep(0.01)
            waited += 0.01
        taken, self.unread = self.unread[:count], self.unread[count:]
        return taken


def _lines(path: Path, pause: float) -> Iterator[Line]:
    """Its conversation, then a goto in its own spelling and ten polls, each after a pause."""
    lines = read(path).lines
    for line in lines:
        yield line
        if line.data.endswith(b":MS#"):
            yield Line(0, "!", b"", "refused")
    mark = b"#" if any(line.data.startswith(b"#:") for line in lines) else b""
    yield Line(0, "!", b"", "position 12:34:56 +45:12:34")
    for packet, reply in ((b":Sr20:00:00#", b"1"), (b":Sd-30*00:00#", b"1"), (b":MS#", REFUSAL)):
        yield Line(0, ">", mark + packet, "")
        yield Line(0, "<", reply, "")
    for _ in range(10):
        yield Line(0, "@", b"", str(pause))
        for packet, reply in ((b":GR#", b"12:34:56#"), (b":GD#", b"+45*12:34#")):
            yield Line(0, ">", mark + packet, "")
            yield Line(0, "<", reply, "")


async def _play(path: Path, pause: float, network: bool) -> list[tuple[bytes, bytes, bytes]]:
    """Return each packet with what must have come for it and what the program read."""
    conversation = read(path)
    gateway = FakeGateway(**_settings(conversation))
    surface = SurfaceConfig(at="lx200@tcp://127.0.0.1:0", equinox="jnow")
    gateway.acceptor.binding = replace(
        gateway.acceptor.binding,
        profiles=tuple(profiles_of("lx200", surface, cast(Any, None))),
        hold_time=text_delay(surface, "lx200", surface.client),
    )
    gateway.mount.faults[op.Goto] = BelowHorizon()
    name = path.stem.removeprefix("lx200-")
    program, packet, heard = Program(gateway, HOW[name], network), b"", []
    for line in _lines(path, pause):
        if line.mark == ">":
            packet += line.data
            continue
        if line.mark == "<":
            if "connections" in conversation.settings:
                program.reconnect()
            expected = REFUSAL if packet.endswith(b":MS#") and line.data == b"0" else line.data
            heard.append((packet, expected, await program.ask(packet, expected)))
            packet = b""
        elif line.mark == "@":
            await asyncio.sleep(float(line.text))
        elif line.text == "refused":
            gateway.mount.slewing = True  # what follows in the conversation is that of a goto
        else:
            _set_up(gateway.mount, gateway.shared, line.text)
            gateway.controller.changed()
    return heard


@each("pause", PAUSES)
@each("path", PROGRAMS)
def test_program_with_refused_gotos_reads_every_reply_whole(path: Path, pause: float) -> None:
    name = path.stem.removeprefix("lx200-")
    over_network = run(_play(path, pause, network=True))
    assert sum(expected == REFUSAL for _, expected, _ in over_network) >= 1
    if name.startswith("indi-"):
        right = [
            (packet, expected, expected[:1] if expected == REFUSAL else expected)
            for packet, expected, _ in over_network
        ]
        assert over_network == right
    else:
        assert over_network == run(_play(path, pause, network=False))
