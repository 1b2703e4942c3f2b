"""What the console costs programs, and how fast its STOP is.

    python tests/benchmarks/console.py [--seconds 20] [--pages 20] [--clients 100] [--stops 50] [--rounds 3]

One gateway with a simulated mount whose line lies in this process. First 100 programs poll alone, then with the pages
open, in turn; told are the 99th percentile of ``:GR#`` and of a program's stop, and the resident memory. Then pages
press an arrow and STOP: what counts is the first stopping byte on the mount's line, less the exchange in flight.
Everything stays on the loopback interface; every process is ended by its own id.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import random
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import aiohttp

from gateway.app.config.endpoints import parse_device
from gateway.app.simulated import make_simulator
from tests.benchmarks.figures import percentile
from tests.benchmarks.processes import HOST, environment
from tests.soak.paced import PacedMount

POLL = 0.5


def is_stop(request: bytes) -> bool:
    """Whether a request to the hand control ends a motion: ``M``, or a fixed rate of 0."""
    return request[:1] == b"M" or (request[:1] == b"P" and request[3:4] in (b"\x24", b"\x25") and request[4:5] == b"\0")


def beyond_the_exchange(mount: PacedMount, asked: float) -> float | None:
    """Seconds from a stop's request, or from the end of the exchange then in flight, to its first byte at the mount."""
    stop = next((one for one in mount.exchanges if one.came >= asked and is_stop(one.request)), None)
    if stop is None:
        return None
    before = [one.ended for one in mount.exchanges if one.came < stop.came and one.ended is not None]
    return stop.came - max(asked, *(end for end in before if end <= stop.came), asked)


async def polled(port: int, seconds: float, times: list[float]) -> None:
    """A program that asks where the mount points, twice a second."""
    reader, writer = await asyncio.open_connection(HOST, port)
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        began = time.perf_counter()
        writer.write(b":GR#")
        await reader.readuntil(b"#")
        times.append(time.perf_counter() - began)
        await asyncio.sleep(POLL)
    writer.close()


async def stopped(port: int, seconds: float, mount: PacedMount, times: list[float]) -> None:
    """A program that presses an arrow and stops, again and again."""
    _, writer = await asyncio.open_connection(HOST, port)
    now = asyncio.get_running_loop().time
    end, ways = now() + seconds, (b":Mn#", b":Ms#")
    count = 0
    while now() < end:
        writer.write(ways[count % 2])
        await asyncio.sleep(0.8)
        asked = now()
        writer.write(b":Q#")
        await asyncio.sleep(0.8)
        took = beyond_the_exchange(mount, asked)
        times += [] if took is None else [took]
        count += 1
    writer.close()


class Page:
    """A page's WebSocket."""

    def __init__(self, ws: aiohttp.ClientWebSocketResponse) -> None:
        self.ws = ws

    async def read(self) -> None:
        """Take what comes, and say that it lives."""
        beat = 0.0
        async for _ in self.ws:
            if time.perf_counter() - beat > POLL:
                beat = time.perf_counter()
                await self.ws.send_str('{"do":"beat"}')


@contextlib.asynccontextmanager
async def pages(where: str, many: int) -> AsyncIterator[list[Page]]:
    async with aiohttp.ClientSession() as http:
        text = await (await http.get(where)).text()
        token = text.split('name="token" content="')[1].split('"')[0]
        found = [Page(await http.ws_connect(f"{where}socket?token={token}")) for _ in range(many)]
        tasks = [asyncio.ensure_future(page.read()) for page in found]
        yield found
        for task in tasks:
            task.cancel()
        for page in found:
            await page.ws.close()


def resident(pid: int) -> float:
    """MiB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024.0


async def measure(options: argparse.Namespace) -> None:
    simulator = make_simulator(parse_device("nexstar:6-8se"), clock=time.time)
    mount = PacedMount(simulator, random.Random(1))
    port = await mount.listen()
    with tempfile.TemporaryDirectory() as folder:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "gateway", "run", "--mount", f"nexstar@socket://{HOST}:{port}", "--sun", "0",
            "--surface", f"lx200@tcp://{HOST}:0", "--console", f"tcp://{HOST}:0", "--state", folder,
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL, env=environment(folder),
        )  # fmt: skip
        try:
            await _measured(options, process, mount)
        finally:
            process.terminate()
            await process.wait()


async def _measured(options: argparse.Namespace, process: Any, mount: PacedMount) -> None:
    surface, where = 0, ""
    while not where:
        line = (await process.stdout.readline()).decode().strip()
        if line.startswith("ready lx200"):
            surface = int(line.rpartition(":")[2])
        elif line.startswith("ready console"):
            where = line.split()[2]
    found: dict[int, tuple[list[float], list[float], list[float]]] = {0: ([], [], []), options.pages: ([], [], [])}
    for _ in range(options.rounds):
        for many, (polls, stops, memory) in found.items():
            async with pages(where, many):
                await asyncio.gather(
                    *(polled(surface, options.seconds, polls) for _ in range(options.clients)),
                    stopped(surface, options.seconds, mount, stops),
                )
                memory.append(resident(process.pid))
    print("pages   :GR# median    p99     stop p99    resident")
    for many, (polls, stops, memory) in found.items():
        print(f"{many:5}   {percentile(polls, 50) * 1e3:8.2f} ms {percentile(polls, 99) * 1e3:6.2f} ms "
              f"{percentile(stops, 99) * 1e3:8.2f} ms {max(memory):8.1f} MiB")  # fmt: skip
    await _stop_of_a_page(options, where, mount)


async def _stop_of_a_page(options: argparse.Namespace, where: str, mount: PacedMount) -> None:
    times = []
    async with pages(where, 1) as [page]:
        for count in range(options.stops):
            way = "north" if count % 2 else "south"
            await page.ws.send_str(json.dumps({"do": "jog", "direction": way, "rate": 4}))
            await asyncio.sleep(0.8)
            asked = asyncio.get_running_loop().time()
            await page.ws.send_str('{"do":"stop"}')
            await asyncio.sleep(1.0)
            took = beyond_the_exchange(mount, asked)
            times += [] if took is None else [took]
    print(f"STOP of a page to the mount, beyond the exchange in flight: {len(times)} of {options.stops} seen, median "
          f"{percentile(times, 50) * 1e3:.2f} ms, p99 {percentile(times, 99) * 1e3:.2f} ms (goal 10)")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("seconds", 20), ("pages", 20), ("clients", 100), ("stops", 50), ("rounds", 3)):
        parser.add_argument(f"--{name}", type=int, default=value)
    asyncio.run(measure(parser.parse_args()))


if __name__ == "__main__":
    main()
