"""Alpaca towards HTTP, as the registry offers it. Nothing of the web server is loaded before somebody asks."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from gateway.core.errors import UserError
from gateway.transport.handler import Listener
from gateway.transport.web_port import WebDevice, WebPort, WebServer


class AlpacaWeb:
    """Ports of its own, and its part of another's."""

    async def open_port(self, where: str, device: WebDevice, names: Sequence[str] = ()) -> Listener:
        """``tcp://HOST:PORT``. Raises UserError."""
        if not where.startswith("tcp://"):
            raise UserError(
                f"{where}: Alpaca is spoken over HTTP: write tcp://HOST:PORT, for example tcp://0.0.0.0:11111"
            )

        async def load() -> WebServer:
            await asyncio.to_thread(import_module, "aiohttp.web")
            from gateway.protocols.alpaca.http.server import AlpacaServer, OwnServer

            return await OwnServer.start(AlpacaServer([device], names))

        port = WebPort(load)
        await port.open(where)
        return port

    def add_routes(
        self, app: Any, devices: Sequence[WebDevice], names: Sequence[str], may_act: Callable[[Any], bool]
    ) -> Callable[[], None]:
        """Serve the devices as a part of the console's application -> what ends that."""
        from gateway.protocols.alpaca.http.server import AlpacaServer

        server = AlpacaServer(devices, names, may_act, console=True)
        server.add_to(app)
        return server.close

    async def answer_discovery(self, places: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """By ASCOM's own way -> what ends that. Raises OSError."""
        from gateway.protocols.alpaca.http.discovery import answer_discovery

        return await answer_discovery(places)
