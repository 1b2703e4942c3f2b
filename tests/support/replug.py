"""A mount's serial port is unplugged and plugged in again, in real time, while programs poll and slew.

The port is a pseudo-terminal behind a symbolic link. Unplugging closes it at the mount's end and removes the link;
plugging in creates another pseudo-terminal under the same link. TCP clients must not be disconnected.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import tempfile
import time
import tty
from pathlib import Path
from random import Random
from typing import Any

from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.app.simulated import make_simulator
from gateway.core.operations import Position


class Plug:
    """The mount's end of the cable."""

    def __init__(self, link: Path, feed: Any) -> None:
        self._link, self._feed = link, feed
        self._files: tuple[int, int] | None = None

    def plug_in(self) -> None:
        """Open a new terminal under the old name."""
        master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(master, False)
        self._link.symlink_to(os.ttyname(slave))
        self._files = master, slave
        asyncio.get_running_loop().add_reader(master, self._read, master)

    def unplug(self) -> None:
        """Remove the link first, then drop the line."""
        if self._files is None:
            return
        self._link.unlink()
        asyncio.get_running_loop().remove_reader(self._files[0])
        for number in self._files:
            os.close(number)
        self._files = None

    def _read(self, master: int) -> None:
        with contextlib.suppress(OSError):
            answer = self._feed(os.read(master, 4096))
            if answer:
                os.write(master, answer)


class Program:
    """A client over TCP that counts its requests and their replies."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self.asked = self.answered = 0
        self.dropped = False

    async def ask(self, data: bytes, end: bytes, patience: float) -> bytes:
        """Return the reply up to ``end``, or the part of it that arrived in time."""
        self.asked += 1
        self._writer.write(data)
        heard = b""
        try:
            async with asyncio.timeout(patience):
                while not heard.endswith(end):
                    piece = await self._reader.read(256)
                    if not piece:
                        self.dropped = True
                        return heard
                    heard += piece
        except TimeoutError:
            return heard
        self.answered += 1
        return heard

    def close(self) -> None:
        self._writer.close()


async def replug(cycles: int, seed: int, polls: float = 0.2) -> dict[str, Any]:
    """Unplug that often; return figures: requests, replies, losses, and how long the link took to recover."""
    draw = Random(seed)
    simulator = make_simulator(Endpoint("nexstar", "-", "cge"), clock=time.time)
    figures: dict[str, Any] = {"cycles": cycles, "gotos": 0, "refused": 0, "back after": [], "wrong": []}
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / "mount"
        plug = Plug(link, simulator.feed)
        plug.plug_in()
        surface = SurfaceConfig(at="lx200@tcp://127.0.0.1:0")
        gateway = Gateway(MountConfig(at=f"nexstar@{link}"), [surface])
        await gateway.open()
        assert await gateway.wait_identified(20.0)
        line = gateway.controller.line
        host, port = gateway.ports[0].address.removeprefix("tcp://").split(":")
        programs = [Program(*await asyncio.open_connection(host, int(port))) for _ in range(3)]
        over = asyncio.Event()

        async def poll(program: Program) -> None:
            while not over.is_set():
                reply = await program.ask(b":GR#:Gc#", b"24#", 30.0)
                if not reply.endswith(b"24#"):
                    figures["wrong"].append(reply)
                await asyncio.sleep(polls)

        async def slew(program: Program) -> None:
            while not over.is_set():
                figures["gotos"] += 1
                target = b":Sr%02d:00:00#:Sd+%02d*00:00#:MS#" % (draw.randrange(24), draw.randrange(50, 80))
                reply = await program.ask(target + b":Gc#", b"24#", 30.0)
                if not reply.startswith(b"11"):
                    figures["wrong"].append(reply)
                figures["refused"] += not reply.startswith(b"110")
                await asyncio.sleep(draw.uniform(0.1, 1.0))

        tasks = [
            asyncio.create_task(poll(programs[0])),
            asyncio.create_task(poll(programs[1])),
            asyncio.create_task(slew(programs[2])),
        ]
        for _ in range(cycles):
            await asyncio.sleep(draw.uniform(0.1, 0.6))
            plug.unplug()
            await asyncio.sleep(draw.uniform(0.0, 0.8))
            plug.plug_in()
            back = time.monotonic()
            while line.state == "up" and time.monotonic() - back < 1.0:  # it may not have noticed yet
                await asyncio.sleep(0.02)
            while line.state != "up" and time.monotonic() - back < 60.0:
                await asyncio.sleep(0.02)
            figures["back after"].append(time.monotonic() - back)
        last = await gateway.controller.read(Position())
        over.set()
        await asyncio.gather(*tasks)
        truth = simulator.true_position()
        figures |= {
            "up": line.state == "up",
            "position": (last.ra, last.dec),
            "truth": truth,
            "asked": sum(program.asked for program in programs),
            "answered": sum(program.answered for program in programs),
            "dropped": sum(program.dropped for program in programs),
        }
        for program in programs:
            program.close()
        await gateway.close()
        plug.unplug()
    return figures
