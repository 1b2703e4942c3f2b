"""How long a program waits for ``:GR#`` and ``:GD#``, or for ``e``, against a server that only echoes.

Client and servers share one core, so that a round trip is the work of both and two context switches, at whatever
frequency the other cores run; the simulated hand control is kept off that core. The servers take turns of a few hundred
round trips, so that every disturbance of the machine affects all of them.
"""

from __future__ import annotations

import os
import shutil
import socket
import time
from contextlib import ExitStack

import processes
from figures import Figure, middle, percentile

BATCH = 500
GOAL = 1.5


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Measure both directions on both event loops."""
    batches = 12 if quick else 120
    return [
        figure
        for way in processes.DIRECTIONS
        for loop in ("fast", "asyncio")
        for figure in _one_loop(bytecode, loop, batches, way)
    ]


def _one_loop(bytecode: str, loop: str, batches: int, way: processes.Direction) -> list[Figure]:
    cores = sorted(os.sched_getaffinity(0))
    times: dict[str, list[float]] = {}
    with ExitStack() as stack:
        with processes.pinned(set(cores[1:]) or set(cores)):
            mount = stack.enter_context(processes.simulator(bytecode, way=way))
        stack.enter_context(processes.pinned({cores[0]}))
        echo = stack.enter_context(processes.echo(bytecode, loop))
        ports = {"echo": echo, "gateway": stack.enter_context(processes.gateway(bytecode, mount, loop, way))}
        if shutil.which("socat"):
            ports["socat"] = stack.enter_context(processes.forwarder(bytecode, echo))
        connections = {name: stack.enter_context(processes.connect(port)) for name, port in ports.items()}
        _settle(connections, way.position[0])
        for _ in range(batches):
            for name, connection in connections.items():
                times.setdefault(name, []).extend(_batch(connection, way.position))
    base, label = middle(times["echo"]), f"{way.name}, {({'fast': 'uvloop', 'asyncio': 'asyncio'})[loop]}"
    figures = [Figure(f"round trip, {label}: gateway, median", middle(times["gateway"]), "us", base, GOAL)]
    if "socat" in times:
        figures.append(Figure(f"round trip, {label}: socat, median", middle(times["socat"]), "us", base))
    last = percentile(times["echo"], 99)
    figures.append(Figure(f"round trip, {label}: gateway, p99", percentile(times["gateway"], 99), "us", last))
    return figures


def _settle(connections: dict[str, socket.socket], question: bytes) -> None:
    """Let the gateway finish what it does after its start, and send every request a few times."""
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        for connection in connections.values():
            connection.sendall(question)
            connection.recv(64)
        time.sleep(0.02)


def _batch(connection: socket.socket, questions: tuple[bytes, ...]) -> list[float]:
    """Return some round trips in microseconds."""
    times = []
    for number in range(BATCH):
        question = questions[number % len(questions)]
        began = time.perf_counter_ns()
        connection.sendall(question)
        reply = connection.recv(64)
        times.append((time.perf_counter_ns() - began) / 1000.0)
        if not reply.endswith((b"#", question)):
            raise RuntimeError(f"{question!r} was answered {reply!r}")
    return times
