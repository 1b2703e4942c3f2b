"""The reference of all measurements: an asyncio server that sends every byte back and does nothing else.

``python echo.py fast`` runs it on uvloop, ``python echo.py asyncio`` on asyncio's own loop.
"""

from __future__ import annotations

import asyncio
import sys
from typing import cast


class Echo(asyncio.Protocol):
    """One connection."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._write = cast(asyncio.Transport, transport).write

    def data_received(self, data: bytes) -> None:
        self._write(data)


async def serve() -> None:
    server = await asyncio.get_running_loop().create_server(Echo, "127.0.0.1", 0)
    print(f"ready echo@tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}", flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    # asyncio reads into a new buffer of 256 KiB. Once a larger one was freed, glibc caches such buffers instead of
    # asking the kernel for each. Every larger program gets there by itself; this one must not be slower than they are.
    bytes(1 << 20)
    factory = None
    if sys.argv[1:] == ["fast"]:
        import uvloop

        factory = uvloop.new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(serve())
