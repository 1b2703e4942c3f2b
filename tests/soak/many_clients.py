"""Two hundred programs on one gateway for minutes: right answers, flat memory, line load and speed as with one client.

    python -m tests.soak.many_clients [--minutes 10] [--clients 200] [--seed 1]

Two gateways, each with its own simulated mount on a 9600-baud wire in this process (``paced.py``); both mounts do the
same gotos. One gateway has the crowd (``crowd.py``), the other a single client; a probe in a third process polls both
in turn. A reply is right if the mount pointed there, to a unit of the wire format, at one of its own position replies
within the permitted age; right ascension and declination at the same one. Exit code 1 if any was not.
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
import time
from collections import deque
from typing import NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator
from gateway.astro.spherical import horizon_to_hour_angle, wrap180, wrap360
from tests.benchmarks import memory, processes
from tests.benchmarks.figures import percentile
from tests.benchmarks.processes import used
from tests.soak.crowd import Outcome, Reported, crowd
from tests.soak.paced import PacedMount
from tests.support.process import Running

#: Seconds a reply may be old: fresh for 0.5, and on its way before; and the rounding of 24 bits on the wire, degrees.
OLDEST, BINARY = 1.0, 180.0 / 2**24
GOTO_EVERY, WEIGH_EVERY = 25.0, 2.0
PROBE_EVERY = 0.05
#: Seconds after the start until the sky is loaded and all clients are connected.
SETTLE = 10.0
#: KiB a minute in the second half that count as flat memory; the greatest ratio of bytes on the line to one client's.
FLAT, LINE = 64.0, 1.1


class Truth:
    """Where a mount really pointed at each position request of the last seconds."""

    def __init__(self, mount: PacedMount) -> None:
        self._mount = mount
        self._places: deque[tuple[float, float, float]] = deque(maxlen=50)
        mount.understood = self._note

    def _note(self, request: bytes) -> None:
        if request == b"e":
            simulator = self._mount.simulator  # its own time stands still since it replied
            self._places.append((asyncio.get_running_loop().time(), *simulator.mechanics.truth(simulator.now)))

    def judge(self, told: Reported, asked: float) -> str:
        """Return what is wrong with a position, or an empty text if the mount reported it lately."""
        oldest, nearest = asked - OLDEST, 360.0
        for at, ra, dec in reversed(self._places):
            if at < oldest:
                break
            east, north = abs(wrap180(told.ra - ra)), abs(told.dec - dec)
            if east <= told.ra_tick + BINARY and north <= told.dec_tick + BINARY:
                return ""
            nearest = min(nearest, max(east, north))
        return f"{nearest * 3600:.1f} arcseconds from where the mount pointed when it was asked"


class Bench(NamedTuple):
    """A gateway, its mount, its LX200 and its NexStar port."""

    mount: PacedMount
    gateway: Running
    lx200: int
    nexstar: int


async def _bench(chance: random.Random, state: str, running: list[Running]) -> Bench:
    mount = PacedMount(make_simulator(Endpoint("nexstar", "sim", "6-8se"), clock=time.time), chance)
    gateway = Running(
        "run",
        "--no-console",
        "--mount",
        f"nexstar@socket://127.0.0.1:{await mount.listen()}",
        "--sun",
        "0",
        "--state",
        state,
        *(word for name in ("lx200", "nexstar") for word in ("--surface", f"{name}@tcp://127.0.0.1:0")),
    )
    running.append(gateway)
    ports = [int((await asyncio.to_thread(gateway.ready)).rpartition(":")[2]) for _ in range(2)]
    return Bench(mount, gateway, ports[0], ports[1])


async def _gotos(benches: list[Bench], chance: random.Random) -> None:
    """Send every mount to the same targets, one after the other."""
    writers = [(await asyncio.open_connection("127.0.0.1", bench.nexstar))[1] for bench in benches]
    while True:
        azimuth, altitude = chance.uniform(0.0, 360.0), chance.uniform(20.0, 75.0)
        simulator = benches[0].mount.simulator
        hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, simulator.site[0])
        ra = wrap360(simulator.mechanics.sky.sidereal(time.time()) - hour_angle)
        for writer in writers:
            writer.write(b"r%06X00,%06X00" % (int(ra / 360.0 * 2**24), int(dec / 360.0 * 2**24) % 2**24))
        await asyncio.sleep(GOTO_EVERY)


async def _weigh(bench: Bench, sizes: list[tuple[float, float]]) -> None:
    loop = asyncio.get_running_loop()
    while True:
        sizes.append((loop.time(), memory.resident(bench.gateway.process.pid)))
        await asyncio.sleep(WEIGH_EVERY)


def slope(points: list[tuple[float, float]]) -> float:
    """Return the slope of the straight line that fits the points best."""
    mean_x, mean_y = (sum(point[axis] for point in points) / len(points) for axis in (0, 1))
    return sum((x - mean_x) * (y - mean_y) for x, y in points) / sum((x - mean_x) ** 2 for x, _ in points)


def _probe(crowded: int, alone: int, seconds: float) -> None:
    """Poll both gateways in turn and print the round trips, in microseconds."""
    connections = [processes.connect(port) for port in (crowded, alone)]
    times: list[list[float]] = [[], []]
    until, number = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        for connection, found in zip(connections, times, strict=True):
            began = time.perf_counter()
            processes.ask(connection, (b":GR#", b":GD#")[number % 2])
            found.append((time.perf_counter() - began) * 1e6)
        number += 1
        time.sleep(PROBE_EVERY)
    print(json.dumps(times))


async def _run(arguments: argparse.Namespace, state: str, running: list[Running]) -> bool:
    """Run everything and print the figures; return whether all of them are as they should be."""
    loop, chance = asyncio.get_running_loop(), random.Random(arguments.seed)
    crowded, alone = [await _bench(chance, state, running) for _ in range(2)]
    truth, outcome, sizes = Truth(crowded.mount), Outcome(), list[tuple[float, float]]()
    tasks = [
        loop.create_task(work)
        for work in (
            _gotos([crowded, alone], chance),
            crowd(crowded.lx200, crowded.nexstar, arguments.clients, chance, outcome, truth.judge),
        )
    ]
    await asyncio.sleep(SETTLE)
    seconds = 60.0 * arguments.minutes
    tasks.append(loop.create_task(_weigh(crowded, sizes)))
    spent = [used(bench.gateway.process.pid) for bench in (crowded, alone)]
    passed, answers = [bench.mount.passed for bench in (crowded, alone)], outcome.answers
    probe = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "tests.soak.many_clients",
        "--probe",
        str(crowded.lx200),
        str(alone.lx200),
        "--minutes",
        str(arguments.minutes),
        stdout=asyncio.subprocess.PIPE,
    )
    said, _ = await probe.communicate()
    rates = [(bench.mount.passed - before) / seconds for bench, before in zip((crowded, alone), passed, strict=True)]
    answers = outcome.answers - answers
    spent = [
        (used(bench.gateway.process.pid) - before) / seconds
        for bench, before in zip((crowded, alone), spent, strict=True)
    ]
    for task in tasks:
        if task.done():
            task.result()
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    for bench in (crowded, alone):
        await asyncio.to_thread(bench.gateway.end)
    many, one = json.loads(said)
    growth = slope(sizes[len(sizes) // 2 :]) * 60.0 * 1024.0
    quarters = [sizes[min(len(sizes) - 1, len(sizes) * part // 4)][1] for part in range(5)]
    print(
        f"seed {arguments.seed}, {arguments.clients} clients, {arguments.minutes:g} minutes: {answers} answers "
        f"({answers / seconds:.0f} a second), {outcome.wrong} wrong, {outcome.killed} clients killed"
    )
    print(*(f"  {words}" for words in outcome.words), sep="\n", end="\n" if outcome.words else "")
    print(
        "memory after every quarter:",
        *(f"{size:.1f}" for size in quarters),
        f"MiB; in the second half {growth:+.1f} KiB a minute",
    )
    print(f"line: {rates[0]:.1f} bytes a second, {rates[1]:.1f} with one client, ratio {rates[0] / rates[1]:.2f}")
    for name, part in (("median", 50.0), ("p99", 99.0)):
        figures = [percentile(times, part) for times in (many, one)]
        print(
            f"round trip, {name}: {figures[0]:.0f} us, {figures[1]:.0f} us with one client, "
            f"ratio {figures[0] / figures[1]:.2f}"
        )
    print(f"processor: the gateway {spent[0]:.0%} of a core, {spent[1]:.0%} with one client")
    print("load of the machine:", *(f"{load:.1f}" for load in os.getloadavg()))
    return not outcome.wrong and growth <= FLAT and rates[0] <= LINE * rates[1]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--probe", type=int, nargs=2, metavar="PORT", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.probe:
        _probe(*arguments.probe, 60.0 * arguments.minutes)
        return 0
    running: list[Running] = []
    well = False
    try:
        with tempfile.TemporaryDirectory() as state, contextlib.suppress(KeyboardInterrupt):
            well = asyncio.run(_run(arguments, state, running))
    finally:
        for one in running:
            if one.process.poll() is None:
                one.process.kill()
                one.process.wait()
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
