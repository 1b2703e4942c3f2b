"""What clients cost the mount's line, and what the gateway itself costs it when nobody is there.

A hand control answers in a fifth of a second: twenty programs that each had their own exchanges would wait for each
other. Five gateways run side by side, each with a simulated hand control that takes a tenth of a second to answer and a
proxy between the two that counts. One of those that twenty programs poll is weighed at the end.
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
#: What the gateway asked of itself at its start is no longer renewed after this time, in seconds.
SETTLE = 3.5
HEARTBEAT = 5.0

PLAIN = ((b":GR#", b":GD#"), 4.0)
BUSY = ((b":GR#", b":GD#", b":D#"), 2.0)


class Case(NamedTuple):
    """A gateway and who polls it: questions and how often a second."""

    name: str
    clients: list[tuple[tuple[bytes, ...], float]]


CASES = (
    Case("one", [PLAIN]),
    Case("twenty", [PLAIN] * 20),
    Case("one-busy", [BUSY]),
    Case("twenty-mixed", [PLAIN] * 10 + [BUSY] * 10),
    Case("nobody", []),
)


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Bytes a second for the cases, requests with nobody there, and the memory of a gateway at work."""
    seconds = 11.0 if quick else 20.0
    with ExitStack() as stack:
        mounts = [stack.enter_context(processes.simulator(bytecode, LATENCY)) for _ in CASES]
        return asyncio.run(_all(bytecode, mounts, seconds))


async def _all(bytecode: str, mounts: list[int], seconds: float) -> list[Figure]:
    loop = asyncio.get_running_loop()
    tallies = [Tally(mount) for mount in mounts]
    polls: list[asyncio.Task[None]] = []
    children = {}
    with ExitStack() as stack:
        try:
            for case, tally in zip(CASES, tallies, strict=True):
                command = processes.gateway_command(await tally.open())
                process = stack.enter_context(processes.child(command, bytecode))
                children[case.name] = process
            for case in CASES:
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
    rates = {case.name: tally.rate(began, ended) for case, tally in zip(CASES, tallies, strict=True)}
    return [
        Figure("line: 20 clients that ask GR GD, against 1", rates["twenty"], "B/s", rates["one"], 1.1),
        Figure("line: 20 clients that ask GR GD (D), against 1", rates["twenty-mixed"], "B/s", rates["one-busy"], 1.1),
        Figure(f"line: most requests in {HEARTBEAT:g} s with no client",
               tallies[-1].busiest(began, ended, HEARTBEAT - 0.05), "", None, 1),
        Figure("memory: resident while 20 clients poll", resident, "MiB", None, memory.GOAL_STEADY),
    ]
