"""What a start, the first page and the first Alpaca program cost those who are connected already, on one core.

    python tests/benchmarks/first_comers.py [--runs 40]

A gateway is started again and again, with an almanac, on a processor of its own, behind a mount at 9600 baud. A program
moves the mount; then the first page is opened, or the first Alpaca program asks, or, for comparison, nobody comes; and
the program stops the mount before the newcomer is answered. The first table shows the time from the stop's byte, or the
end of the exchange in flight, to the first stopping byte at the mount.

A timer in the gateway's event loop is due every millisecond. The second table shows its longest delays, and the most
processor time that the loop's own thread used in one of them, which other programs on the computer do not change:
until the program's port is open, from then on, and while somebody comes; beside a loop that has nothing to do, whose
delays are the computer's own.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import sys
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import aiohttp

from tests.benchmarks.console import beyond_the_exchange, simulated
from tests.benchmarks.figures import middle, percentile
from tests.benchmarks.processes import HOST, ROOT, environment, exact, free_port, pinned
from tests.soak.paced import PacedMount

#: The last one is the gateway's; the mount and the programs are on the others, if there are any.
PROCESSORS = sorted(os.sched_getaffinity(0))
#: Goals, seconds: of a stop beyond the exchange, and of the time for which the start holds the loop.
STOP, HELD = 0.020, 0.005
#: Seconds that a start is watched; that nobody comes, and within which the stop is sent; until an almanac is there; and
#: that a newcomer may wait.
STARTED, NOBODY, SPREAD, CALCULATED, PATIENCE = 2.0, 1.0, 0.3, 130.0, 30.0
#: Runs a gateway, or an empty loop for some seconds, with the timer in its event loop, and writes to a file when each
#: beat came (monotonic time), how late it was, and the processor time of the loop's thread since the last one.
PROGRAM = """
import asyncio, atexit, json, sys, time
import uvloop
BEAT = 0.001
make, beats = uvloop.new_event_loop, []
def beating():
    loop = make()
    def beat(last, used):
        now, own = time.monotonic(), time.thread_time()
        beats.append((now, now - last - BEAT, own - used))
        loop.call_later(BEAT, beat, now, own)
    loop.call_soon(beat, time.monotonic(), time.thread_time())
    return loop
uvloop.new_event_loop = beating
atexit.register(lambda: json.dump(beats, open(sys.argv[1], "w")))
if sys.argv[2] == "empty":
    with asyncio.Runner(loop_factory=beating) as runner:
        runner.run(asyncio.sleep(float(sys.argv[3])))
else:
    from gateway.cli import main
    sys.exit(main(sys.argv[2:]))
"""


class Beat(NamedTuple):
    """When a beat came, by how much it was late, and what the loop's thread used since the last one; seconds."""

    at: float
    late: float
    used: float


class Running(NamedTuple):
    """A gateway's port for an LX200 program, when that was open, and where its page and its Alpaca port are."""

    port: int
    opened: float
    page: str
    alpaca: str


@contextlib.asynccontextmanager
async def gateway(mount: int, folder: str) -> AsyncIterator[Running]:
    """Run a gateway on the last processor; its beats are in the file ``beats`` afterwards."""
    port = free_port()
    surfaces = ["--surface", f"lx200@tcp://{HOST}:{port}", "--surface", f"alpaca@tcp://{HOST}:0"]
    words = ["run", "--mount", f"nexstar@socket://{HOST}:{mount}", "--sun", "0", *surfaces]
    with pinned({PROCESSORS[-1]}):
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", PROGRAM, f"{folder}/beats", *words, "--console", f"tcp://{HOST}:0",
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL, env=environment(folder), cwd=ROOT,
        )  # fmt: skip
    assert process.stdout is not None
    try:
        async with asyncio.timeout(PATIENCE):
            opened = await _open(port)
            where: dict[str, str] = {}
            while len(where) < 3:
                kind, _, rest = (await process.stdout.readline()).decode().removeprefix("ready ").strip().partition(" ")
                kind, _, at = kind.partition("@")
                where[kind.partition(":")[0]] = at or rest
        yield Running(port, opened, where["console"], where["alpaca"])
    finally:
        process.terminate()
        await process.wait()


async def _open(port: int) -> float:
    """Return when a port accepts connections, to a millisecond."""
    while True:
        with contextlib.suppress(ConnectionRefusedError):
            (await asyncio.open_connection(HOST, port))[1].close()
            return asyncio.get_running_loop().time()
        await asyncio.sleep(0.001)


def beats(folder: str, since: float, until: float) -> list[Beat]:
    """Return those of the program that has ended."""
    every = [Beat(*one) for one in json.loads(Path(folder, "beats").read_text())]
    return [beat for beat in every if since <= beat.at <= until]


async def page(http: aiohttp.ClientSession, where: Running) -> None:
    """Open the page, as a browser does, until it shows the mount."""
    token = (await (await http.get(where.page)).text()).split('name="token" content="')[1].split('"')[0]
    async with http.ws_connect(f"{where.page}socket?token={token}") as ws:
        await ws.receive()


async def alpaca(http: aiohttp.ClientSession, where: Running) -> None:
    """Ask for the position, as an Alpaca program does."""
    at = where.alpaca.removeprefix("tcp://")
    answer = await (await http.get(f"http://{at}/api/v1/telescope/0/rightascension?ClientID=1")).json()
    assert answer["ErrorNumber"] == 0, answer


async def nobody(http: aiohttp.ClientSession, where: Running) -> None:
    await asyncio.sleep(NOBODY)


COMERS: tuple[Callable[[aiohttp.ClientSession, Running], Awaitable[None]], ...] = (nobody, page, alpaca)


async def stop(writer: asyncio.StreamWriter, mount: PacedMount) -> tuple[float, float]:
    """Stop a little later; return when, and the seconds that it took beyond the exchange."""
    await asyncio.sleep(random.uniform(0.0, SPREAD))
    asked = asyncio.get_running_loop().time()
    writer.write(b":Q#")
    async with asyncio.timeout(PATIENCE):
        while (took := beyond_the_exchange(mount, asked)) is None:
            await asyncio.sleep(0.01)
    return asked, took


async def measure(runs: int) -> bool:
    """Measure and print; return whether the goals are met."""
    loop, (mount, port) = asyncio.get_running_loop(), await simulated()
    taken: dict[str, list[float]] = {comer.__name__: [] for comer in COMERS}
    held: dict[str, list[Beat]] = {name: [] for name in ("empty loop", "until the port is open", "then, nobody comes")}
    with tempfile.TemporaryDirectory() as folder:
        async with gateway(port, folder):  # compiles, and calculates the almanac
            async with asyncio.timeout(CALCULATED):
                while not await asyncio.to_thread(exact, folder):
                    await asyncio.sleep(1.0)
        for number in range(runs * len(COMERS)):
            comer, began = COMERS[number % len(COMERS)], loop.time()
            async with gateway(port, folder) as where, aiohttp.ClientSession() as http:
                await asyncio.sleep(STARTED)
                _, writer = await asyncio.open_connection(HOST, where.port)
                writer.write((b":Mn#", b":Ms#")[number % 2])
                await asyncio.sleep(random.uniform(0.3, 0.8))
                came, stopping = loop.time(), asyncio.ensure_future(stop(writer, mount))
                async with asyncio.timeout(PATIENCE):
                    await comer(http, where)
                answered = loop.time()
                asked, took = await stopping
                writer.close()
            taken[comer.__name__] += [took] if asked <= answered else []
            held["until the port is open"] += beats(folder, began, where.opened)
            held["then, nobody comes"] += beats(folder, where.opened, came)
            if comer is not nobody:
                held.setdefault(f"first {comer.__name__} comes", []).extend(beats(folder, came, answered))
        with pinned({PROCESSORS[-1]}):
            idle = [sys.executable, "-c", PROGRAM, f"{folder}/beats", "empty", str(runs * STARTED)]
            await (await asyncio.create_subprocess_exec(*idle)).wait()
        held["empty loop"] = beats(folder, 0.0, loop.time())
    print(f"stop beyond the exchange     median      p99  longest  (goal p99 {STOP * 1e3:g} ms)")
    for name, times in taken.items():
        print(f"  {name:22} {middle(times) * 1e3:8.2f} {percentile(times, 99) * 1e3:8.2f} {max(times) * 1e3:8.2f} ms  "
              f"{len(times)} stops")  # fmt: skip
    print(f"the event loop is held        longest   p99.9  own work, longest  (goal {HELD * 1e3:g} ms from open)")
    for name, all_beats in held.items():
        late, used = [beat.late for beat in all_beats], [beat.used for beat in all_beats]
        print(f"  {name:22} {max(late) * 1e3:12.2f} {percentile(late, 99.9) * 1e3:7.2f} {max(used) * 1e3:8.2f} ms")
    print("load of the machine:", *(f"{one:.1f}" for one in os.getloadavg()))
    quick = all(percentile(taken[name], 99) <= STOP for name in ("page", "alpaca"))
    return quick and max(beat.used for beat in held["then, nobody comes"]) <= HELD


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40, help="starts for each newcomer")
    with pinned(set(PROCESSORS[:-1] or PROCESSORS)):
        return 0 if asyncio.run(measure(parser.parse_args().runs)) else 1


if __name__ == "__main__":
    sys.exit(main())
