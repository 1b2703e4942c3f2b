"""What the console costs programs, and how fast its STOP is.

    python tests/benchmarks/console.py [--seconds 15] [--pages 20] [--clients 100] [--stops 40] [--rounds 5]

One gateway with a simulated mount whose line is in this process. 100 programs poll it, first while the mount tracks,
and then while one of them presses a direction key and stops again and again. The figures are the 99th percentiles of
``:GR#`` (the median of the rounds) and of such a stop (of all rounds together). In every round the same pages, one of
them in Chromium, are connected first to another gateway and then to this one, so that the computer has the same work.
The pages run in a process of their own (``console_pages.py``). Then a page presses a direction key and STOP: the
measure is the first stopping byte on the mount's line, minus the exchange in flight. Resident memory and the time to
the surfaces' ``ready`` are compared with ``--no-console``, and first visits are timed (``console_ready.py``).
``chrt -f 10`` in front keeps other programs out of the figures. All traffic stays on the loopback interface; every
process is ended by its own id.
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
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import aiohttp

from gateway.app.config.endpoints import parse_device
from gateway.app.simulated import make_simulator
from tests.benchmarks.console_ready import tell_ready
from tests.benchmarks.figures import middle, percentile
from tests.benchmarks.processes import HOST, environment
from tests.soak.paced import PacedMount

POLL = 0.5
#: Seconds for which a program holds a direction key, and then waits.
PRESSED = 0.25
#: Seconds in which a newly started gateway loads the astronomy.
WARM = 8.0


def is_stop(request: bytes) -> bool:
    """Whether a request to the hand control ends a motion: ``M``, or a fixed rate of 0."""
    return request[:1] == b"M" or (request[:1] == b"P" and request[3:4] in (b"\x24", b"\x25") and request[4:5] == b"\0")


def beyond_the_exchange(mount: PacedMount, asked: float) -> float | None:
    """Return seconds from a stop request, or the end of the exchange in flight, to its first byte at the mount."""
    stop = next((one for one in mount.exchanges if one.came >= asked and is_stop(one.request)), None)
    if stop is None:
        return None
    before = [one.ended for one in mount.exchanges if one.came < stop.came and one.ended is not None]
    return stop.came - max(asked, *(end for end in before if end <= stop.came), asked)


async def polled(port: int, seconds: float, times: list[float]) -> None:
    """Poll the position twice a second."""
    reader, writer = await asyncio.open_connection(HOST, port)
    end = time.perf_counter() + seconds
    await asyncio.sleep(POLL * random.random())
    await _asked(reader, writer)  # the first request is slower, because the gateway has just accepted the program
    while time.perf_counter() < end:
        times.append(await _asked(reader, writer))
        await asyncio.sleep(POLL * random.uniform(0.5, 1.5))
    writer.close()


async def _asked(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> float:
    began = time.perf_counter()
    writer.write(b":GR#")
    await reader.readuntil(b"#")
    return time.perf_counter() - began


async def stopped(port: int, many: int, mount: PacedMount, times: list[float]) -> None:
    """Press a direction key and stop, again and again."""
    _, writer = await asyncio.open_connection(HOST, port)
    for count in range(many):
        writer.write((b":Mn#", b":Ms#")[count % 2])
        await asyncio.sleep(PRESSED + 0.1 * random.random())
        asked = asyncio.get_running_loop().time()
        writer.write(b":Q#")
        await asyncio.sleep(PRESSED)
        took = beyond_the_exchange(mount, asked)
        times += [] if took is None else [took]
    writer.close()


@contextlib.asynccontextmanager
async def pages(where: str, many: int) -> AsyncIterator[None]:
    """Keep this many pages open, one of them in Chromium."""
    program = str(Path(__file__).with_name("console_pages.py"))
    process = await asyncio.create_subprocess_exec(
        sys.executable, program, where, str(many), "--chromium",
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
    )  # fmt: skip
    assert process.stdin is not None and process.stdout is not None
    try:
        assert (await process.stdout.readline()).strip() == b"open", "the pages did not open"
        await asyncio.sleep(3.0)  # the browser has painted
        yield
    finally:
        process.stdin.close()
        await process.wait()


def resident(pid: int) -> float:
    """Return MiB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024.0


class Running(NamedTuple):
    """A gateway: its process, its surface's port, its page's address, seconds until the surface was ready."""

    pid: int
    port: int
    where: str
    ready: float


@contextlib.asynccontextmanager
async def gateway(port: int, console: bool, bytecode: str) -> AsyncIterator[Running]:
    """Run a gateway over the mount's port."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "gateway", "run", "--mount", f"nexstar@socket://{HOST}:{port}", "--sun", "0",
            "--surface", f"lx200@tcp://{HOST}:0", "--state", folder,
            *(["--console", f"tcp://{HOST}:0"] if console else ["--no-console"]),
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL, env=environment(bytecode),
        )  # fmt: skip
        assert process.stdout is not None
        try:
            surface, where, ready = 0, "", 0.0
            while not surface or (console and not where):
                line = (await process.stdout.readline()).decode().strip()
                if line.startswith("ready lx200"):
                    surface, ready = int(line.rpartition(":")[2]), time.perf_counter() - began
                elif line.startswith("ready console"):
                    where = line.split()[2]
            yield Running(process.pid, surface, where, ready)
        finally:
            process.terminate()
            await process.wait()


class Round(NamedTuple):
    """One stretch of polling: seconds, and MiB."""

    polls: list[float]
    stops: list[float]
    memory: float


async def stretch(options: argparse.Namespace, running: Running, mount: PacedMount) -> Round:
    """Let programs poll; then let one of them also move and stop."""
    polls: list[float] = []
    stops: list[float] = []
    await asyncio.gather(*(polled(running.port, options.seconds, polls) for _ in range(options.clients)))
    moving = options.stops * (2 * PRESSED + 0.05)
    await asyncio.gather(
        *(polled(running.port, moving, []) for _ in range(options.clients)),
        stopped(running.port, options.stops, mount, stops),
    )
    return Round(polls, stops, resident(running.pid))


async def simulated() -> tuple[PacedMount, int]:
    """Return a mount on a line, and its port."""
    simulator = make_simulator(parse_device("nexstar:6-8se"), clock=time.time)
    mount = PacedMount(simulator, random.Random(1))
    return mount, await mount.listen()


async def measure(options: argparse.Namespace) -> None:
    (mount, port), (_, another) = await simulated(), await simulated()
    with tempfile.TemporaryDirectory() as bytecode:
        await _starts(options, port, bytecode)
        async with gateway(port, False, bytecode) as running:
            await asyncio.sleep(WARM)
            bare = await stretch(options, running, mount)
        async with gateway(port, True, bytecode) as running, gateway(another, True, bytecode) as elsewhere:
            await asyncio.sleep(WARM)
            await tell_ready(running.where, options.rounds)
            found: dict[str, list[Round]] = {"no console": [bare], "elsewhere": [], "here": []}
            for _ in range(options.rounds):
                for name, where in (("elsewhere", elsewhere.where), ("here", running.where)):
                    async with pages(where, options.pages):
                        found[name].append(await stretch(options, running, mount))
            _tell(options.pages, found)
            await _stop_of_a_page(options, running.where, mount)


def _tell(pages: int, found: dict[str, list[Round]]) -> None:
    print(f"{pages} pages      :GR# p99, rounds    a stop: median     p99    resident")
    shown: dict[str, tuple[float, float]] = {}
    for name, rounds in found.items():
        polls = [percentile(one.polls, 99) * 1e3 for one in rounds]
        stops = [took * 1e3 for one in rounds for took in one.stops]
        shown[name] = middle(polls), percentile(stops, 99)
        each = " ".join(f"{one:.2f}" for one in polls)
        print(f"{name:10}   {shown[name][0]:6.2f} ms {each}   {middle(stops):9.2f} ms "
              f"{shown[name][1]:6.2f} ms ({len(stops)})  {max(one.memory for one in rounds):5.1f} MiB")  # fmt: skip
    (polls_alone, stops_alone), (polls_seen, stops_seen) = shown["elsewhere"], shown["here"]
    print(f"with pages here by with pages elsewhere, 99th percentiles: :GR# {polls_seen / polls_alone:.2f}, a stop "
          f"{stops_seen / stops_alone:.2f} (goal 1.10)", flush=True)  # fmt: skip


async def _starts(options: argparse.Namespace, port: int, bytecode: str) -> None:
    """Start alternately without a console and with one; the very first start compiles, and does not count."""
    times: dict[bool, list[float]] = {False: [], True: []}
    for count in range(options.starts + 1):
        for console, found in times.items():
            async with gateway(port, console, bytecode) as running:
                found += [running.ready] if count else []
    without, having = (middle(found) * 1e3 for found in times.values())
    print(f"start to the surface's ready, median of {options.starts}: {without:.0f} ms without a console, "
          f"{having:.0f} ms with one", flush=True)  # fmt: skip


async def _stop_of_a_page(options: argparse.Namespace, where: str, mount: PacedMount) -> None:
    times = []
    async with aiohttp.ClientSession() as http:
        token = (await (await http.get(where)).text()).split('name="token" content="')[1].split('"')[0]
        async with http.ws_connect(f"{where}socket?token={token}") as ws:
            for count in range(options.stops):
                way = "north" if count % 2 else "south"
                await ws.send_str(json.dumps({"do": "jog", "direction": way, "rate": 4}))
                await asyncio.sleep(0.8)
                asked = asyncio.get_running_loop().time()
                await ws.send_str('{"do":"stop"}')
                await asyncio.sleep(1.0)
                took = beyond_the_exchange(mount, asked)
                times += [] if took is None else [took]
    print(f"STOP of a page to the mount, beyond the exchange in flight: {len(times)} of {options.stops} seen, median "
          f"{percentile(times, 50) * 1e3:.2f} ms, p99 {percentile(times, 99) * 1e3:.2f} ms (goal 10)")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("seconds", 15), ("pages", 20), ("clients", 100), ("stops", 40), ("rounds", 5), ("starts", 5)):
        parser.add_argument(f"--{name}", type=int, default=value)
    asyncio.run(measure(parser.parse_args()))


if __name__ == "__main__":
    main()
