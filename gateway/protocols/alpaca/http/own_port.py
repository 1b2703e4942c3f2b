"""The web server of a port of Alpaca's own."""

from __future__ import annotations

import asyncio

from aiohttp import web

from gateway.protocols.alpaca.http.server import LONGEST, AlpacaServer
from gateway.system.web_log import web_log

#: Seconds that requests under way are given at the end.
END = 0.5


class OwnServer:
    """Makes those who talk to connections."""

    def __init__(self, runner: web.AppRunner, alpaca: AlpacaServer) -> None:
        self._runner, self._alpaca = runner, alpaca

    @classmethod
    async def start(cls, alpaca: AlpacaServer) -> OwnServer:
        """Ready for connections."""
        app = web.Application(client_max_size=LONGEST)
        alpaca.add_to(app)
        runner = web.AppRunner(app, access_log=None, handle_signals=False, shutdown_timeout=END, logger=web_log())
        await runner.setup()
        return cls(runner, alpaca)

    def __call__(self) -> asyncio.Protocol:
        assert self._runner.server is not None
        return self._runner.server()

    async def close(self) -> None:
        """Nobody is answered any more."""
        self._alpaca.close()
        await self._runner.cleanup()
