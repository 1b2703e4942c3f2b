"""A stop waits for one exchange at most, in real processes: over TCP, RFC 2217 and a serial pair that lose replies."""

from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path

import pytest

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator
from gateway.transport import open_port
from gateway.transport.handler import NewConnection
from tests.support.lossy_line import is_stop
from tests.support.process import Running

#: Seconds that the mount takes to answer, that a stop may wait beyond that, and that a busy computer may add.
LATENCY, WAITS, BUSY = 0.05, 0.3, 0.8


class MountAtPort:
    """A simulated mount behind a port of this process. It loses the next ``lost`` replies, and notes stops."""

    all_answered = True

    def __init__(self, mount: str) -> None:
        protocol, _, model = mount.partition(":")
        self.sim = make_simulator(Endpoint(protocol, "sim", model), clock=time.time)
        self.lost, self.stops = 0, list[float]()
        self.last_lost = asyncio.Event()

    def accept(self, connected: NewConnection) -> MountAtPort:
        self._write, self._hear = connected.write, self.sim.connection()
        return self

    def feed(self, data: bytes) -> None:
        if is_stop(data):
            self.stops.append(time.monotonic())
        answer = self._hear(data)
        if answer and self.lost:
            self.lost -= 1
            if not self.lost:
                self.last_lost.set()
        elif answer:
            asyncio.get_running_loop().call_later(LATENCY, self._write, answer)

    def peer_closed(self) -> None:
        pass

    def close(self) -> None:
        pass


PORTS = {"tcp": "tcp://127.0.0.1:0", "rfc2217": "rfc2217://127.0.0.1:0", "pair": "pty:"}


@pytest.mark.real_time
@pytest.mark.parametrize("lost", [1, 2])
@pytest.mark.parametrize("mount", ["nexstar:cge", "lx200:lx200gps"])
@pytest.mark.parametrize("port", list(PORTS))
@pytest.mark.skipif(os.name == "nt", reason="there are no pseudo-terminals")
@pytest.mark.safety_line(1)
async def test_stop_waits_for_at_most_one_exchange_at_a_real_port(
    port: str, mount: str, lost: int, tmp_path: Path
) -> None:
    at_port = MountAtPort(mount)
    where = PORTS[port] + (str(tmp_path / "mount") if port == "pair" else "")
    listener = await open_port(where, at_port.accept)
    url = {"tcp": "socket", "rfc2217": "rfc2217"}.get(port, "")
    address = f"{url}://{listener.address.partition('://')[2]}" if url else str(tmp_path / "mount")
    gateway = Running(
        "run", "--mount", f"{mount.partition(':')[0]}@{address}", "--surface", "lx200@tcp://127.0.0.1:0",
        "--state", str(tmp_path / "state"), "--sun", "0", "--lowest", "-90", "--no-discovery",
    )  # fmt: skip
    try:
        host, _, number = (await asyncio.to_thread(gateway.ready)).removeprefix("tcp://").rpartition(":")
        reader, writer = await asyncio.open_connection(host, int(number))
        async with asyncio.timeout(30.0):
            writer.write(b":RS#:Me#")
            for _ in range(20):
                writer.write(b":GR#")
                await reader.readuntil(b"#")
                await asyncio.sleep(0.1)
            at_port.stops.clear()
            at_port.lost = lost
            while not at_port.last_lost.is_set():
                writer.write(b":GR#:GD#")
                await asyncio.sleep(0.05)
            pressed = time.monotonic()
            writer.write(b":Q#")
            while not at_port.stops:
                await asyncio.sleep(0.01)
        assert at_port.stops[0] - pressed < LATENCY + WAITS + BUSY
        writer.close()
    finally:
        await asyncio.to_thread(gateway.end_at_once)
        await listener.close()
