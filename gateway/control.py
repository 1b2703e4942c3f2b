"""How ``mount-gateway stop`` reaches the gateways that run.

A gateway listens on a loopback port of its own and writes the port and a secret into a file that only its user can
read; that is the same on every system. One line in, ``SECRET stop``; one line back when the mount has acknowledged it,
``stopped`` or ``failed REASON``.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import os
import secrets
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgspec
from msgspec import Struct

from gateway.errors import Fault
from gateway.state import write_whole

#: Seconds that a mount has to acknowledge a stop; a hand control takes 3.5 for one answer at worst.
ACKNOWLEDGED = 5.0
LONGEST_LINE = 256


class Door(Struct):
    """What the file tells: which mount, which process, and how to get in."""

    mount: str
    pid: int
    port: int
    secret: str


class Control:
    """A gateway's side. ``stop`` ends every motion and returns when the mount has acknowledged it, or raises Fault."""

    def __init__(self, directory: Path, name: str, mount: str, stop: Callable[[], Awaitable[None]]) -> None:
        self.path = directory / f"{name}.{os.getpid()}.control"
        self._mount, self._stop = mount, stop
        self._secret = secrets.token_hex(16)
        self._server: asyncio.Server | None = None

    async def open(self) -> None:
        """Raises OSError where the file cannot be written or no port can be had."""
        with contextlib.suppress(OSError):
            await sweep(self.path.parent)
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0, limit=LONGEST_LINE)
        port = self._server.sockets[0].getsockname()[1]
        write_whole(self.path, msgspec.json.encode(Door(self._mount, os.getpid(), port, self._secret)), flush=False)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, ValueError, TimeoutError):
            async with asyncio.timeout(ACKNOWLEDGED):
                line = await reader.readline()
            if hmac.compare_digest(line.strip(), f"{self._secret} stop".encode()):
                writer.write(f"{await self._outcome()}\n".encode())
                await writer.drain()
        writer.close()

    async def _outcome(self) -> str:
        try:
            async with asyncio.timeout(ACKNOWLEDGED):
                await self._stop()
        except TimeoutError:
            return f"failed no answer from the mount within {ACKNOWLEDGED:.0f} s"
        except Fault as fault:
            return f"failed {fault}"
        return "stopped"

    async def close(self) -> None:
        """Nobody gets in any more."""
        if self._server is not None:
            self._server.close()
            with contextlib.suppress(OSError):
                self.path.unlink(missing_ok=True)


def doors(directory: Path) -> list[tuple[Path, Door]]:
    """The gateways that run on a directory, or did: a file outlives a killed one. Raises OSError."""
    found = []
    for path in sorted(directory / name for name in os.listdir(directory) if name.endswith(".control")):
        with contextlib.suppress(FileNotFoundError, msgspec.MsgspecError):
            found.append((path, msgspec.json.decode(path.read_bytes(), type=Door)))
    return found


async def _enter(path: Path, door: Door) -> tuple[asyncio.StreamReader, asyncio.StreamWriter] | None:
    """A connection; None where nobody listens any more, and the file is taken away."""
    try:
        async with asyncio.timeout(1.0):
            return await asyncio.open_connection("127.0.0.1", door.port)
    except (OSError, TimeoutError):
        with contextlib.suppress(OSError):
            path.unlink()
        return None


async def sweep(directory: Path) -> None:
    """Take away what killed gateways have left."""
    for path, door in doors(directory):
        entered = await _enter(path, door)
        if entered is not None:
            entered[1].close()


async def ask_to_stop(path: Path, door: Door) -> str | None:
    """-> ``stopped`` or ``failed REASON``; None where nobody listens any more."""
    entered = await _enter(path, door)
    if entered is None:
        return None
    reader, writer = entered
    try:
        writer.write(f"{door.secret} stop\n".encode())
        async with asyncio.timeout(ACKNOWLEDGED + 1.0):
            answer = (await reader.readline()).decode("ascii", "replace").strip()
    except (OSError, TimeoutError):
        answer = ""
    finally:
        writer.close()
    return answer or f"failed the gateway (process {door.pid}) does not answer"
