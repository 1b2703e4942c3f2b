"""The HTTP part of Alpaca for the registry. What serves the requests is imported when the first client connects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from gateway.transport.web_server import WebDevice


class AlpacaWeb:
    """Alpaca as a part of the web server."""

    def load(self) -> None:
        """Import the routes, and with them aiohttp."""
        import_module("gateway.protocols.alpaca.http.server")

    def add_routes(self, app: Any, devices: Sequence[WebDevice]) -> None:
        """Add the devices to the application."""
        from gateway.protocols.alpaca.http.server import AlpacaServer

        AlpacaServer(devices).add_to(app)

    async def answer_discovery(self, places: Sequence[tuple[str, int]]) -> Callable[[], None]:
        """Answer ASCOM's discovery; return the function that ends this. Raises OSError."""
        from gateway.protocols.alpaca.http.discovery import answer_discovery

        return await answer_discovery(places)
