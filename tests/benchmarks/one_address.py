"""What a port for every protocol costs: the round trip against a port of one protocol, and the first replies.

Both ports belong to the same gateway and take turns of a few hundred round trips. For the first replies, programs of
five kinds are connected to one port at once; each kind then reconnects again and again, while the others continue.
"""

from __future__ import annotations

import os
import select
import socket
import time
from contextlib import ExitStack

import processes
from figures import Figure, middle
from round_trip import BATCH

#: The ratio of ``:GR#`` on a port for every protocol to one for LX200; milliseconds until a first reply.
GOAL, FIRST = 1.05, 20.0
GET = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
ALPACA = b"GET /management/apiversions HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
#: Kind of program -> its first bytes, and the beginning or end of their reply.
KINDS = {
    "LX200": (b":GR#", b"#"),
    "NexStar": (b"e", b"#"),
    "browser": (GET, b"HTTP/1.1 200"),
    "Alpaca": (ALPACA, b"HTTP/1.1 200"),
}
#: The size of one of the positions that are sent without a request.
TOLD = 24


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Measure on both event loops."""
    return [figure for loop in ("fast", "asyncio") for figure in _one_loop(bytecode, loop, quick)]


def _one_loop(bytecode: str, loop: str, quick: bool) -> list[Figure]:
    cores = sorted(os.sched_getaffinity(0))
    label = {"fast": "uvloop", "asyncio": "asyncio"}[loop]
    with ExitStack() as stack:
        with processes.pinned(set(cores[1:]) or set(cores)):
            mount = stack.enter_context(processes.simulator(bytecode))
        stack.enter_context(processes.pinned({cores[0]}))
        anywhere = f"tcp://{processes.HOST}:0"
        command = processes.gateway_command(mount, loop=loop)
        command += ["--surface", f"any@{anywhere}", "--console", anywhere]
        process = stack.enter_context(processes.child(command, bytecode))
        ports = [processes.port_of(process) for _ in range(2)]
        assert process.stdout is not None
        next(line for line in process.stdout if line.startswith(b"ready console"))
        one, every = (stack.enter_context(processes.connect(port)) for port in ports)
        for connection in (one, every):
            _ask(connection, b":GR#")
        time.sleep(1.5)  # the gateway finishes what it does after its start
        figures = _round_trips(one, every, 12 if quick else 120, label)
        return [*figures, *_first_answers(stack, ports[1], 5 if quick else 40, label)]


def _round_trips(one: socket.socket, every: socket.socket, batches: int, label: str) -> list[Figure]:
    times: dict[socket.socket, list[float]] = {one: [], every: []}
    for _ in range(batches):
        for connection, taken in times.items():
            for _ in range(BATCH):
                began = time.perf_counter_ns()
                _ask(connection, b":GR#")
                taken.append((time.perf_counter_ns() - began) / 1000.0)
    name = f"one address, {label}: :GR# on any@ against lx200@, median"
    return [Figure(name, middle(times[every]), "us", middle(times[one]), GOAL)]


def _first_answers(stack: ExitStack, port: int, rounds: int, label: str) -> list[Figure]:
    """Measure first replies while one program of each kind is connected already and continues to work."""
    silent = stack.enter_context(processes.connect(port))
    time.sleep(3.5)
    others = {kind: stack.enter_context(processes.connect(port)) for kind in KINDS}
    worst = dict.fromkeys(KINDS, 0.0)
    for _ in range(rounds):
        for kind, (said, answer) in KINDS.items():
            with processes.connect(port) as connection:
                began = time.perf_counter()
                heard = _ask(connection, said)
                worst[kind] = max(worst[kind], (time.perf_counter() - began) * 1000.0)
                _check(kind, heard, answer)
            for other, (asked, right) in KINDS.items():
                _check(other, _ask(others[other], asked), right)
            while select.select([silent], [], [], 0.0)[0]:
                told = silent.recv(TOLD, socket.MSG_WAITALL)
                _check("Stellarium", told, told[:4] if told[:4] == b"\x18\0\0\0" else b"?")
    return [
        Figure(f"one address, {label}: first answer to {kind}, the longest", took, "ms", None, FIRST)
        for kind, took in worst.items()
    ]


def _ask(connection: socket.socket, said: bytes) -> bytes:
    """Send something and return its reply; of a page, all of it."""
    connection.sendall(said)
    heard = connection.recv(65536)
    while heard.startswith(b"HTTP/") and not _whole(heard):
        heard += connection.recv(65536)
    return heard


def _whole(page: bytes) -> bool:
    head, _, body = page.partition(b"\r\n\r\n")
    lengths = [line.partition(b":")[2] for line in head.split(b"\r\n") if line.lower().startswith(b"content-length:")]
    return bool(lengths) and len(body) >= int(lengths[0])


def _check(kind: str, heard: bytes, right: bytes) -> None:
    if not (heard.startswith(right) or heard.endswith(right)):
        raise RuntimeError(f"{kind} was answered {heard[:100]!r}")
