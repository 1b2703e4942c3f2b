"""The view of programs of the other protocol: the goto that such a program would send, in its protocol.

The program is connected to a surface of the gateway, in this process: it sends the bytes of its protocol and gets the
replies.
"""

from __future__ import annotations

from gateway.app.gateway import Gateway
from gateway.core import operations as op
from gateway.core.operations import Values
from gateway.diagnostics.log.conversation import Heard, Side
from gateway.diagnostics.prove.findings import StageReporter
from gateway.diagnostics.prove.gotos import LONGEST, there_and_back
from gateway.diagnostics.prove.telescope import WHO, CheckedMount, Ended
from gateway.protocols.registry import other_surface
from gateway.protocols.wireformat.command_set import load
from gateway.transport.handler import Connected

#: Seconds for a reply, and between two questions whether a goto is over.
PATIENCE, EVERY = 6.0, 0.5


class SurfaceConnection:
    """A connection to the surface of this protocol. Raises Ended if the gateway has none."""

    def __init__(self, telescope: CheckedMount, protocol: str) -> None:
        gateway: Gateway = telescope.gateway
        self._telescope, self._heard = telescope, b""
        self._side, self._commands = Side(protocol), load(protocol).commands
        endpoints = zip(gateway.endpoints, gateway.acceptors, strict=True)
        acceptors = [acceptor for endpoint, acceptor in endpoints if endpoint.protocol == protocol]
        if not acceptors:
            raise Ended(f"this gateway has no surface for {protocol} programs")
        self._handler = acceptors[-1].accept(Connected("prove:program", WHO, self._hear))
        self.close = self._handler.close

    def _hear(self, data: bytes) -> None:
        self._heard += data

    async def ask(self, name: str, **values: object) -> Heard:
        """Send the command of this name and return its reply, empty if it has none. Raises Ended."""
        frame = self._commands[name].request.encode(values)
        self._heard = b""
        self._side.command(frame)
        self._handler.feed(frame)
        if not self._commands[name].replies:
            return Heard(b"", "")
        if not await self._telescope.until(lambda: bool(self._heard) and self._handler.answered, PATIENCE):
            raise Ended("a program was not answered")
        return self._side.reply(self._heard)


async def run(telescope: CheckedMount, report: StageReporter) -> None:
    """Raises Ended."""
    presented = other_surface(telescope.driver.protocol.name)
    program, commands = SurfaceConnection(telescope, presented), load(presented).extra("prove.toml")["goto"]

    async def go(to: op.Equatorial) -> tuple[str, op.Equatorial | None]:
        telescope.mine = True
        for order in commands["orders"]:
            if (heard := await program.ask(order, ra=to.ra, dec=to.dec)).fails:
                telescope.mine = False
                return heard.text, None
        end = telescope.now() + LONGEST
        while telescope.now() < end:
            if set((await program.ask(commands["tells"])).fields.values()) & set(commands["over"]):
                break
            await telescope.until(lambda: False, EVERY)
        values: Values = {}
        for question in commands["position"]:
            values |= (await program.ask(question)).fields
        if not {"ra", "dec"} <= values.keys():
            raise Ended("a program did not receive the position")
        return "", op.Equatorial(values["ra"], values["dec"])

    names = f"goto of a program ({presented})", f"its goto back ({presented})"
    try:
        await there_and_back(
            telescope, report, names, go, "Programs read a different position from the one that the mount reached."
        )
    finally:
        program.close()
