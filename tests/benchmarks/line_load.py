"""What clients cost the mount's line, and what the gateway itself costs it without clients.

A hand control replies in a fifth of a second: twenty programs with exchanges of their own would wait for each other.
Five gateways run side by side, each with a simulated hand control that takes a tenth of a second to reply, and a proxy
between the two that counts. At the end the memory of a gateway with twenty programs is measured.
"""

from __future__ import annotations

import asyncio
from contextlib import ExitStack
from typing import NamedTuple

import memory
import processes
from figures import Figure
from tally import Tally, poll

LATENCY = 0.1
#: Seconds after which the gateway no longer renews what it read for itself at its start.
SETTLE = 7.0
HEARTBEAT = 5.0


class Case(NamedTuple):
    """A gateway and the programs that poll it: requests, and how often a second."""

    name: str
    clients: list[tuple[tuple[bytes, ...], float]]


def cases(way: processes.Direction) -> tuple[Case, ...]:
    """Return the cases: one program and twenty that poll positions, the same with half polling the slew, and none."""
    plain, busy = (way.position, 4.0), ((*way.position, way.slewing), 2.0)
    return (
        Case("one", [plain]),
        Case("twenty", [plain] * 20),
        Case("one-busy", [busy]),
        Case("twenty-mixed", [plain] * 10 + [busy] * 10),
        Case("no client", []),
    )


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Measure bytes a second for the cases, requests without clients, and the memory of a gateway at work."""
    seconds = 11.0 if quick else 20.0
    figures: list[Figure] = []
    for way in processes.DIRECTIONS:
        with ExitStack() as stack:
            mounts = [stack.enter_context(processes.simulator(bytecode, LATENCY, way)) for _ in cases(way)]
            figures += asyncio.run(_all(bytecode, mounts, seconds, way))
    return figures


async def _all(bytecode: str, mounts: list[int], seconds: float, way: processes.Direction) -> list[Figure]:
    loop = asyncio.get_running_loop()
    tallies = [Tally(mount) for mount in mounts]
    polls: list[asyncio.Task[None]] = []
    children = {}
    weighed = cases(way)
    with ExitStack() as stack:
        try:
            for case, tally in zip(weighed, tallies, strict=True):
                command = processes.gateway_command(await tally.open(), way=way)
                process = stack.enter_context(processes.child(command, bytecode))
                children[case.name] = process
            for case in weighed:
                port = await asyncio.to_thread(processes.port_of, children[case.name])
                for number, (questions, rate) in enumerate(case.clients):
                    delay = number / len(case.clients) / rate
                    polls.append(loop.create_task(poll(port, questions, rate, delay)))
            await asyncio.sleep(SETTLE)
            began = loop.time()
            await asyncio.sleep(seconds)
            ended = loop.time()
            for task in polls:
                if task.done():
                    task.result()
            resident = memory.resident(children["twenty-mixed"].pid)
        finally:
            for task in polls:
                task.cancel()
            await asyncio.gather(*polls, return_exceptions=True)
            for process in children.values():
                process.terminate()
            for tally in tallies:
                await tally.close()
    rates = {case.name: tally.rate(began, ended) for case, tally in zip(weighed, tallies, strict=True)}
    return [
        Figure(f"line, {way.name}: 20 clients, against 1", rates["twenty"], "B/s", rates["one"], 1.1),
        Figure(f"line, {way.name}: 20 mixed clients, against 1", rates["twenty-mixed"], "B/s", rates["one-busy"], 1.1),
        Figure(
            f"line, {way.name}: most requests in {HEARTBEAT:g} s, no client",
            tallies[-1].busiest(began, ended, HEARTBEAT - 0.05),
            "",
            None,
            way.heartbeat,
        ),
        Figure(f"memory, {way.name}: while 20 clients poll", resident, "MiB", None, memory.GOAL_STEADY),
    ]
