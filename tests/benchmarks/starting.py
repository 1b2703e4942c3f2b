"""From the start of the process to the first exact answer, against a Python that only imports asyncio and pyserial.

The client starts first and tries to connect every millisecond. A reply counts if it is where the simulated hand control
points. The two programs are started in turn, after one start each that only writes the bytecode.
"""

from __future__ import annotations

import subprocess
import sys
import time

import memory
import processes
from figures import Figure, middle

BASE = [sys.executable, "-c", "import asyncio, serial"]
GOAL = 2.0


def measure(bytecode: str, quick: bool) -> list[Figure]:
    """Measure milliseconds to the first answer, and the size of the process at that moment."""
    times: list[float] = []
    bases: list[float] = []
    sizes: list[float] = []
    with processes.simulator(bytecode) as mount:
        truth = _pointing(mount)
        for _ in range(1 + (10 if quick else 20)):
            bases.append(_base(bytecode))
            taken, size = _first_answer(bytecode, mount, truth)
            times.append(taken)
            sizes.append(size)
    return [
        Figure("start: first answer, median", middle(times[1:]), "ms", middle(bases[1:]), GOAL),
        Figure("memory: resident at the first answer", middle(sizes[1:]), "MiB", None, memory.GOAL_EARLY),
    ]


def _base(bytecode: str) -> float:
    began = time.perf_counter()
    subprocess.run(BASE, cwd=processes.ROOT, env=processes.environment(bytecode), check=True)
    return (time.perf_counter() - began) * 1000.0


def _first_answer(bytecode: str, mount: int, truth: float) -> tuple[float, float]:
    """Return milliseconds, and the resident memory in MiB."""
    port = processes.free_port()
    began = time.perf_counter()
    with processes.child(processes.gateway_command(mount, port), bytecode) as process:
        with processes.connect_early(port) as connection:
            reply = processes.ask(connection, b":GR#")
            taken = (time.perf_counter() - began) * 1000.0
        size = memory.resident(process.pid)
        if not processes.exact(bytecode):
            raise RuntimeError("the gateway has answered without an almanac")
    hours, minutes, seconds = (int(part) for part in reply.rstrip(b"#").split(b":"))
    off = (hours * 3600 + minutes * 60 + seconds - truth + 43200.0) % 86400.0 - 43200.0
    if abs(off) > 1.5:
        raise RuntimeError(f"the gateway answered {reply!r}, {off:.1f} s from where the mount points")
    return taken, size


def _pointing(mount: int) -> float:
    """Return the right ascension of the hand control in seconds of time (NexStar protocol, Get precise RA/DEC)."""
    with processes.connect(mount) as connection:
        word = processes.ask(connection, b"e").split(b",")[0]
    return int(word, 16) / 2**32 * 86400.0
