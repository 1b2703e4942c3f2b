"""How long a program waits for ``:GR#`` and ``:GD#``, against a server that only echoes.

Client and servers share one core, so that a round trip is the work of both and two switches between them, whatever
frequency the other cores run at; the simulated hand control is kept off that core. The servers take turns of a few
hundred round trips, so that whatever disturbs the machine disturbs all of them.
"""

from __future__ import annotations

import os
import shutil
import socket
import time
from contextlib import ExitStack

import processes
from figures import Figure, middle, percentile

QUESTIONS = (b":GR#", b":GD#")
BATCH = 500
GOAL = 1.5


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Both event loops."""
    batches = 20 if quick else 200
    return [figure for loop in ("fast", "asyncio") for figure in _one_loop(bytecode, loop, batches)]


def _one_loop(bytecode: str, loop: str, batches: int) -> list[Figure]:
    cores = sorted(os.sched_getaffinity(0))
    times: dict[str, list[float]] = {}
    with ExitStack() as stack:
        with processes.pinned(set(cores[1:]) or set(cores)):
            mount = stack.enter_context(processes.simulator(bytecode))
        stack.enter_context(processes.pinned({cores[0]}))
        echo = stack.enter_context(processes.echo(bytecode, loop))
        ports = {"echo": echo, "gateway": stack.enter_context(processes.gateway(bytecode, mount, loop))}
        if shutil.which("socat"):
            ports["socat"] = stack.enter_context(processes.forwarder(bytecode, echo))
        connections = {name: stack.enter_context(processes.connect(port)) for name, port in ports.items()}
        _settle(connections)
        for _ in range(batches):
            for name, connection in connections.items():
                times.setdefault(name, []).extend(_batch(connection))
    base, label = middle(times["echo"]), {"fast": "uvloop", "asyncio": "asyncio"}[loop]
    figures = [Figure(f"round trip, {label}: gateway, median", middle(times["gateway"]), "us", base, GOAL)]
    if "socat" in times:
        figures.append(Figure(f"round trip, {label}: socat, median", middle(times["socat"]), "us", base))
    last = percentile(times["echo"], 99)
    figures.append(Figure(f"round trip, {label}: gateway, p99", percentile(times["gateway"], 99), "us", last))
    return figures


def _settle(connections: dict[str, socket.socket]) -> None:
    """Let the gateway finish what it does after its start, and have everything called a few times."""
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        for connection in connections.values():
            processes.ask(connection, QUESTIONS[0])
        time.sleep(0.02)


def _batch(connection: socket.socket) -> list[float]:
    """Some round trips, each in microseconds."""
    times = []
    for number in range(BATCH):
        question = QUESTIONS[number % len(QUESTIONS)]
        began = time.perf_counter_ns()
        connection.sendall(question)
        reply = connection.recv(64)
        times.append((time.perf_counter_ns() - began) / 1000.0)
        if not reply.endswith(b"#"):
            raise RuntimeError(f"{question!r} was answered {reply!r}")
    return times
