"""A program at a surface of the gateway, in this process: it sends the bytes of a protocol and gets the replies."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

from gateway.app.gateway import Gateway
from gateway.core.operations import Values
from gateway.diagnostics.log.conversation import Heard, Side
from gateway.diagnostics.prove.telescope import WHO, Ended
from gateway.protocols.wireformat.command_set import load
from gateway.transport.handler import Connected

#: Seconds for a reply, and between two looks for one.
PATIENCE, LOOK = 6.0, 0.02


class Program:
    """A connection to the surface of this protocol. Raises Ended if the gateway has none."""

    def __init__(self, gateway: Gateway, protocol: str, name: str = "program") -> None:
        self.protocol, self._heard, self._side = protocol, b"", Side(protocol)
        endpoints = zip(gateway.endpoints, gateway.acceptors, strict=True)
        found = [acceptor for endpoint, acceptor in endpoints if endpoint.protocol == protocol]
        if not found:
            raise Ended(f"this gateway has no surface for {protocol} programs")
        self._handler = gateway.entrance.accept(found[-1])(Connected(f"prove:{name}", WHO, self._hear))

    def _hear(self, data: bytes) -> None:
        self._heard += data

    async def ask(self, name: str, **values: object) -> Heard | None:
        """Send the command of this name and return its reply; None without one."""
        command = load(self.protocol).commands[name]
        frame = command.request.encode(values)
        self._heard = b""
        self._side.command(frame)
        self._handler.feed(frame)
        if not command.replies:
            return None
        loop = asyncio.get_running_loop()
        end = loop.time() + PATIENCE
        while loop.time() < end:
            await asyncio.sleep(LOOK)
            if self._heard and self._handler.answered:
                return self._side.reply(self._heard)
        return None

    async def values(self, *names: str) -> Values:
        """Ask these commands and return the fields of all replies."""
        found: Values = {}
        for name in names:
            if (heard := await self.ask(name)) is not None and not heard.fails:
                found |= heard.fields
        return found

    def close(self) -> None:
        self._handler.close()


def readable(gateway: Gateway, left_alone: frozenset[str]) -> Iterator[str]:
    """Yield the commands of the mount's protocol that only read something, and that this mount has."""
    driver = gateway.controller.driver
    for name, command in driver.protocol.commands.items():
        asks = command.question and command.answer != "stream" and not command.request.fields and command.asked
        if asks and not command.beyond and name not in left_alone and driver.supports(name):
            yield name
