"""How long a stop waits beyond the exchange in flight, from the client's byte to the mount's byte. Standalone.

    python -m tests.soak.stop_latency [--seconds 60] [--copies 3] [--clients 20] [--seed 1]

Real gateways, each with a mount of its own behind 9600 baud (``paced.py``); clients and mounts live in this process
and share its clock. A client starts a motion and ends it at a random time by ``:Q#`` or ``:Qn#``, by ``M`` or rate 0.
The measure is the first stopping byte at the mount, minus the later of the client's byte and the end of the exchange in
flight: idle, among many that poll, and while another client floods the gateway. An arrow that was held for a second at
most is a tap: its end is due when it has moved the mount for as long as it was held. Beside it stands how late a bare
echo server was meanwhile, the machine's own delay, which the gateway has twice: on its way in and out.

Clients and mounts stand for other computers: with enough processors the gateway has one of its own, and the crowd uses
only idle time. The 99th percentile is over all kinds of ends together: of every stop, and of those during which the
machine kept all its processors (``stolen.py``); the latter is judged. A crowd with wrong or missing replies fails too.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import gc
import itertools
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator
from tests.benchmarks import processes
from tests.benchmarks.figures import percentile
from tests.benchmarks.processes import used
from tests.soak.paced import PacedMount
from tests.soak.stolen import StolenTime, watched
from tests.support.process import Running

#: Seconds on the way to a gateway, and from there to the mount.
RACE = 0.001
LONGEST, TAP = 1.2, 1.0
GOAL = 0.002
LOST = 4.0
#: How often each program of a crowd asks, a second.
RATE = 5.0
#: The end of a tap is no stop: it waits for the whole pause after the exchange before it, seconds.
PAUSE = 0.05
#: The endings that release an arrow.
RELEASES = (":Qn#", "rate 0")
FLOOD_EVERY = 0.02
#: The seconds before and after the client's byte in which no processor may be away: the same for every stop.
BEFORE, AFTER = 0.02, 0.15


class Stop(NamedTuple):
    """How a stop was sent, when, and how late it arrived, seconds."""

    ending: str
    sent: float
    added: float


class Ending(NamedTuple):
    """Commands that start a motion, there and back, and one that ends it; and tests for them at the mount."""

    name: str
    begin: tuple[bytes, ...]
    end: bytes
    begins: Callable[[bytes], bool]
    stops: Callable[[bytes], bool]


class Setup(NamedTuple):
    """A surface, a mount, and what a flooding client sends."""

    name: str
    mount: str
    model: str
    surface: str
    endings: tuple[Ending, ...]
    flood: tuple[bytes, ...]


def _slew(axis: int, positive: bool, rate: int) -> bytes:
    return bytes((ord("P"), 2, axis, 36 if positive else 37, rate, 0, 0, 0))


def _nexstar_stops(request: bytes) -> bool:
    return request == b"M" or (request[:1] == b"P" and request[3:5] in (b"\x24\0", b"\x25\0"))


def _nexstar_moves(request: bytes) -> bool:
    return request[:3] == b"P\2\x11" and request[3:4] in b"\x24\x25" and request[4] != 0


SETUPS = (
    Setup("LX200 on NexStar", "nexstar", "cge", "lx200", (
        Ending(":Q#", (b":RM#:Mn#", b":RM#:Ms#"), b":Q#", _nexstar_moves, _nexstar_stops),
        Ending(":Qn#", (b":RM#:Mn#", b":RM#:Ms#"), b":Qn#", _nexstar_moves,
               lambda request: request[:5] == b"P\2\x11\x24\0"),
    ), (b":GR#", b":GD#", b":GA#", b":GZ#", b":GS#", b":D#", b":GW#", b":Gt#", b":TQ#", b":TL#", b":TS#", b":RC#:Me#",
        b":Qe#", b":Sr05:00:00#", b":Sd+80*00:00#", b":Mge0100#")),
    Setup("NexStar on LX200", "lx200", "lx200gps", "nexstar", (
        Ending("M", (b"r20000000,20000000", b"r30000000,20000000"), b"M", lambda request: request == b":MS#",
               lambda request: request.lstrip(b"#") == b":Q#"),
        Ending("rate 0", (_slew(17, True, 7), _slew(17, False, 7)), _slew(17, True, 0),
               lambda request: request in (b":Mn#", b":Ms#"),
               lambda request: request.lstrip(b"#") in (b":Qn#", b":Qs#", b":Q#")),
    ), (b"e", b"z", b"L", b"t", b"w", b"h", b"J", b"V", _slew(16, True, 5), _slew(16, True, 0),
        b"P\3\x10\6\xff\xff\0\0", b"P\3\x10\6\xff\xfd\0\0", b"T\2")),
)  # fmt: skip


class Bench(NamedTuple):
    """One gateway with its mount, and the port its clients use; ``both`` are its LX200 and its NexStar port.

    What reaches the mount ``RACE`` seconds after a client's byte was sent before the gateway had read that byte.
    """

    setup: Setup
    mount: PacedMount
    gateway: Running
    port: int
    both: tuple[int, int]


#: The processors of this machine: the last one is the gateway's, the others, if any, are for everything else.
PROCESSORS = sorted(os.sched_getaffinity(0))
OTHERS = PROCESSORS[:-1] or PROCESSORS


@contextlib.contextmanager
def _beside() -> Iterator[None]:
    """Run processes that are started within the block on the gateway's processor."""
    os.sched_setaffinity(0, PROCESSORS[-1:])
    yield
    os.sched_setaffinity(0, OTHERS)


async def _bench(setup: Setup, chance: random.Random, state: str, running: list[Running]) -> Bench:
    """Start a gateway and wait until it is ready."""
    mount = PacedMount(make_simulator(Endpoint(setup.mount, "sim", setup.model), clock=time.time), chance)
    where = f"{setup.mount}@socket://127.0.0.1:{await mount.listen()}"
    with _beside():
        gateway = Running(
            "run",
            "--no-console",
            "--mount",
            where,
            "--sun",
            "0",
            "--state",
            state,
            "--lowest",
            "-90",
            "--dead-man",
            "600",
            *(word for name in ("lx200", "nexstar") for word in ("--surface", f"{name}@tcp://127.0.0.1:0")),
        )
    running.append(gateway)
    ports = [int((await asyncio.to_thread(gateway.ready)).rpartition(":")[2]) for _ in range(2)]
    return Bench(setup, mount, gateway, ports[setup.surface == "nexstar"], (ports[0], ports[1]))


async def _drain(reader: asyncio.StreamReader) -> None:
    while await reader.read(4096):
        pass


async def _measure(bench: Bench, until: float, chance: random.Random, found: list[Stop]) -> None:
    """Start motions one after the other, and end each at a random moment."""
    loop = asyncio.get_running_loop()
    reader, writer = await asyncio.open_connection("127.0.0.1", bench.port)
    drain = loop.create_task(_drain(reader))
    for number in itertools.count():
        if loop.time() > until:
            break
        ending = bench.setup.endings[number // 2 % len(bench.setup.endings)]
        first = len(bench.mount.exchanges)
        pressed = loop.time()
        writer.write(ending.begin[number % 2])
        await asyncio.sleep(chance.uniform(0.0, LONGEST))
        before = len(bench.mount.exchanges)
        sent = loop.time()
        writer.write(ending.end)
        added = await _added(bench, first, before, pressed, sent, ending)
        if added is not None:
            found.append(Stop(ending.name, sent, added))
        await asyncio.sleep(chance.uniform(0.3, 0.8))  # a stop is several exchanges
    drain.cancel()
    writer.close()


async def _added(bench: Bench, first: int, before: int, pressed: float, sent: float, ending: Ending) -> float | None:
    """Return the seconds that the stop waited longer than necessary, LOST if it did not come; None without a motion.

    ``first`` and ``before`` are how many exchanges there were when the motion was begun and when it was ended.
    """
    loop, exchanges = asyncio.get_running_loop(), bench.mount.exchanges
    stop = None
    while stop is None and loop.time() < sent + LOST:
        await asyncio.sleep(0.005)
        stop = next((one for one in exchanges[before:] if ending.stops(one.request)), None)
    begun = next((one.came for one in exchanges[first:] if ending.begins(one.request)), None)
    if begun is None or stop is None:
        return None if begun is None else LOST
    tap = ending.name in RELEASES and sent - pressed <= TAP
    wanted = max(sent, begun + sent - pressed) if tap else sent
    earlier = exchanges[max(0, before - 1) : exchanges.index(stop, before)]
    in_flight = [one.ended for one in earlier if one.came <= wanted + RACE and one.ended is not None]
    return max(0.0, stop.came - max(wanted, max(in_flight, default=0.0) + PAUSE * tap))


async def _flood(bench: Bench, chance: random.Random) -> None:
    """Run a client that sends random commands quickly."""
    reader, writer = await asyncio.open_connection("127.0.0.1", bench.port)
    drain = asyncio.get_running_loop().create_task(_drain(reader))
    try:
        while True:
            writer.write(chance.choice(bench.setup.flood))
            await asyncio.sleep(FLOOD_EVERY)
    finally:
        drain.cancel()
        writer.close()


async def _echo(port: int, found: list[float]) -> None:
    """Measure the delay of a program on this machine that only returns what it receives."""
    loop = asyncio.get_running_loop()
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    while True:
        await asyncio.sleep(0.05)
        began = loop.time()
        writer.write(b":GR#")
        await reader.readexactly(4)
        found.append(loop.time() - began)


async def _situation(
    name: str,
    setups: Sequence[Setup],
    arguments: argparse.Namespace,
    chance: random.Random,
    state: str,
    running: list[Running],
) -> bool:
    """Measure one situation and print its rows; return whether the goal was met."""
    loop = asyncio.get_running_loop()
    copies = arguments.copies if name == "idle" else 1
    benches = [await _bench(setup, chance, state, running) for setup in setups for _ in range(copies)]
    crowds = []
    found: dict[str, list[Stop]] = {}
    bare: list[float] = []
    with processes.echo(state, "asyncio") as echo:
        if name == "crowd":
            for bench in benches:
                crowds.append(
                    await asyncio.create_subprocess_exec(
                        sys.executable,
                        "-m",
                        "tests.soak.crowd",
                        *map(str, bench.both),
                        "--clients",
                        str(arguments.clients),
                        "--rate",
                        str(RATE),
                        "--idle",
                    )
                )
        background = [loop.create_task(_echo(echo, bare))]
        if name == "flood":
            background += [loop.create_task(_flood(bench, chance)) for bench in benches]
        await asyncio.sleep(2.0)
        gc.freeze()  # this process must not be the cause of delays
        until = loop.time() + arguments.seconds * arguments.copies / copies
        began, spent = loop.time(), [used(bench.gateway.process.pid) for bench in benches]
        async with contextlib.AsyncExitStack() as stack:
            stolen = await stack.enter_async_context(watched(PROCESSORS))
            await asyncio.gather(
                *(_measure(bench, until, chance, found.setdefault(bench.setup.name, [])) for bench in benches)
            )
        spent = [(used(bench.gateway.process.pid) - before) / (loop.time() - began)
                 for bench, before in zip(benches, spent, strict=True)]  # fmt: skip
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        for process in crowds:
            process.send_signal(signal.SIGINT)
        answered = [await process.wait() == 0 for process in crowds]
    for bench in benches:
        await asyncio.to_thread(bench.gateway.end)
        if bench.gateway.said:
            print(f"  {bench.setup.name} said: {bench.gateway.said[-1000:]}")
    print(f"{name}: a bare echo took {percentile(bare, 50) * 1e3:.2f} ms, p99 {percentile(bare, 99) * 1e3:.2f} ms")
    print("  a gateway used", ", ".join(f"{100.0 * one:.1f}" for one in spent), "% of a processor")
    met = [_report(setup, stops, stolen, GOAL) for setup, stops in found.items()]
    return all(met) and all(answered)


def _report(setup: str, stops: list[Stop], stolen: StolenTime, goal: float) -> bool:
    """Print the rows of one surface and mount; return whether the goal was met."""
    alone = [stop for stop in stops if not stolen.between(stop.sent - BEFORE, stop.sent + AFTER)]
    endings = sorted({stop.ending for stop in stops})
    rows = [(name, [stop.added for stop in stops if stop.ending == name]) for name in endings]
    rows += [("every one", [stop.added for stop in stops]), ("undisturbed", [stop.added for stop in alone])]
    for name, added in rows:
        if added:
            print(
                f"  {setup:<17} {name:<11} {len(added):4} times: median {percentile(added, 50) * 1e3:7.2f} ms, "
                f"p99 {percentile(added, 99) * 1e3:7.2f} ms, longest {max(added) * 1e3:7.2f} ms",
                flush=True,
            )
    if not stolen.seen:
        print("  lost processor time could not be watched (no real-time priority)")
    return bool(alone) and percentile([stop.added for stop in alone], 99) <= goal


async def _all(arguments: argparse.Namespace, running: list[Running]) -> bool:
    met = True
    for name in arguments.situations:  # with a load one gateway at a time, so that the load is its own
        for setups in [SETUPS] if name == "idle" else [(setup,) for setup in SETUPS]:
            with tempfile.TemporaryDirectory() as state:
                met &= await _situation(name, setups, arguments, random.Random(arguments.seed), state, running)
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="of every situation")
    parser.add_argument("--copies", type=int, default=3, help="gateways side by side; under a load, longer")
    parser.add_argument("--clients", type=int, default=20, help="of a crowd")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--situations", nargs="+", default=["idle", "crowd", "flood"])
    arguments = parser.parse_args()
    os.sched_setaffinity(0, OTHERS)
    running: list[Running] = []
    try:
        met = asyncio.run(_all(arguments, running))
    finally:
        for one in running:
            if one.process.poll() is None:
                one.process.kill()
                one.process.wait()
    print(f"seed {arguments.seed}: {'as' if met else 'NOT as'} it should be")
    print("load of the machine:", *(f"{one:.1f}" for one in os.getloadavg()))
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
