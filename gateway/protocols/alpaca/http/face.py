"""The HTTP part of Alpaca for the registry. The web server is imported when the first client connects."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from gateway.core.errors import UserError
from gateway.transport.handler import Listener
from gateway.transport.web_port import WebDevice, WebPort, WebServer


class AlpacaWeb:
    """Alpaca on a port of its own, and as a part of the console's port."""

    def load(self) -> None:
        """Import the server, and with it aiohttp."""
        import_module("gateway.protocols.alpaca.http.server")

    async def open_port(self, where: str, device: WebDevice, names: Sequence[str] = ()) -> Listener:
        """Listen on ``tcp://HOST:PORT``. Raises UserError for another kind of address."""
        if not where.startswith("tcp://"):
            raise UserError(f"{where}: Alpaca uses HTTP: write tcp://HOST:PORT, for example tcp://0.0.0.0:11111")

        async def load() -> WebServer:
            await asyncio.to_thread(self.load)
            from gateway.protocols.alpaca.http.server import AlpacaServer, OwnServer

            return await OwnServer.start(AlpacaServer([device], names))

        port = WebPort(load)
        await port.open(where)
        return port

    def add_routes(
        self, app: Any, devices: Sequence[WebDevice], names: Sequence[str], may_act: Callable[[Any], bool]
    ) -> Callable[[], None]:
        """Add the devices to the console's application; return the function that ends this."""
        from gateway.protocols.alpaca.http.server import AlpacaServer

        server = AlpacaServer(devices, names, may_act, console=True)
        server.add_to(app)
        return server.close

    async def answer_discovery(self, places: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Answer ASCOM's discovery; return the function that ends this. Raises OSError."""
        from gateway.protocols.alpaca.http.discovery import answer_discovery

        return await answer_discovery(places)
