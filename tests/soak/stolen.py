"""When a processor was not there: taken away by what this machine runs on, or by its kernel. Standalone, or by a proof.

    python -m tests.soak.stolen PROCESSOR

A task of real-time priority sleeps there for half a millisecond at a time. Nothing that other programs do can make it
late, so where it is, nobody was served: it prints from when to when, in seconds of the monotonic clock.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import os
import sys
import time
from collections.abc import AsyncIterator, Sequence

NAP = 0.0005
#: It is late by some hundredths of a millisecond always.
LATE = 0.0005


def watch(processor: int) -> None:
    """Print until killed, or left alone. Raises PermissionError where real-time priority is not to be had."""
    os.sched_setaffinity(0, {processor})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    gc.disable()
    print("watching", flush=True)
    parent = os.getppid()
    while os.getppid() == parent:
        began = time.monotonic()
        time.sleep(NAP)
        ended = time.monotonic()
        if ended - began > NAP + LATE:
            print(f"{began + NAP:.6f} {ended:.6f}", flush=True)


class Thefts:
    """``spans`` are those so far, of all processors; ``seen`` whether they could be watched at all."""

    def __init__(self) -> None:
        self.spans: list[tuple[float, float]] = []
        self.seen = True

    def between(self, begin: float, end: float) -> bool:
        """Whether a processor was away in that time."""
        return any(began < end and ended > begin for began, ended in self.spans)

    async def read(self, stream: asyncio.StreamReader) -> None:
        """Take down what a watcher prints."""
        self.seen &= await stream.readline() == b"watching\n"
        while line := await stream.readline():
            began, ended = map(float, line.split())
            self.spans.append((began, ended))


@contextlib.asynccontextmanager
async def watched(processors: Sequence[int]) -> AsyncIterator[Thefts]:
    """Watch these processors meanwhile."""
    thefts = Thefts()
    watchers = [
        await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            "tests.soak.stolen",
            str(processor),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )
        for processor in processors
    ]
    reading = [asyncio.create_task(thefts.read(watcher.stdout)) for watcher in watchers if watcher.stdout is not None]
    try:
        yield thefts
    finally:
        for watcher in watchers:
            with contextlib.suppress(ProcessLookupError):
                watcher.kill()
            await watcher.wait()
        await asyncio.gather(*reading)


if __name__ == "__main__":
    watch(int(sys.argv[1]))
