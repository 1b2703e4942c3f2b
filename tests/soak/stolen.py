"""When a processor was taken away, by the host of a virtual machine or the kernel. Standalone, and part of others.

    python -m tests.soak.stolen PROCESSOR

A task of real-time priority sleeps on it for half a millisecond at a time. No other program can delay it, so if it
wakes late, no program ran: it prints the beginning and the end, in seconds of the monotonic clock.
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
#: The sleep is always late by some hundredths of a millisecond.
LATE = 0.0005


def watch(processor: int) -> None:
    """Print until killed, or until the parent has ended. Raises PermissionError without real-time priority."""
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


class StolenTime:
    """``spans`` are those so far, of all processors; ``seen`` whether they could be watched at all."""

    def __init__(self) -> None:
        self.spans: list[tuple[float, float]] = []
        self.seen = True

    def between(self, begin: float, end: float) -> bool:
        """Whether a processor was taken away in that time."""
        return any(began < end and ended > begin for began, ended in self.spans)

    async def read(self, stream: asyncio.StreamReader) -> None:
        """Record what a watcher prints."""
        self.seen &= await stream.readline() == b"watching\n"
        while line := await stream.readline():
            began, ended = map(float, line.split())
            self.spans.append((began, ended))


@contextlib.asynccontextmanager
async def watched(processors: Sequence[int]) -> AsyncIterator[StolenTime]:
    """Watch these processors within the block."""
    stolen = StolenTime()
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
    reading = [asyncio.create_task(stolen.read(watcher.stdout)) for watcher in watchers if watcher.stdout is not None]
    try:
        yield stolen
    finally:
        for watcher in watchers:
            with contextlib.suppress(ProcessLookupError):
                watcher.kill()
            await watcher.wait()
        await asyncio.gather(*reading)


if __name__ == "__main__":
    watch(int(sys.argv[1]))
