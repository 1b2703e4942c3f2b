"""Lets a process run for a share of the time, as on a slower processor. Standalone, and part of others.

    python -m tests.soak.share PID SHARE

It is stopped and continued by signals, a hundred times a second. As root this has real-time priority, so that the
share does not depend on what else the computer does.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

#: Seconds from one pause to the next.
ROUND = 0.01


def pause(share: float) -> float:
    """Return the seconds of a pause."""
    return ROUND * (1.0 - share)


def used(pid: int) -> float:
    """Return the seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def hold(pid: int, share: float) -> None:
    """Stop and continue a process, until it or the parent has ended."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    parent = os.getppid()
    with contextlib.suppress(ProcessLookupError):
        while os.getppid() == parent:
            os.kill(pid, signal.SIGSTOP)
            time.sleep(pause(share))
            os.kill(pid, signal.SIGCONT)
            time.sleep(ROUND * share)


@contextlib.asynccontextmanager
async def limited(pid: int, share: float) -> AsyncIterator[None]:
    """Let a process of this user run for a share of the time within the block."""
    words = [sys.executable, "-m", "tests.soak.share", str(pid), str(share)]
    holder = await asyncio.create_subprocess_exec(*words)
    try:
        yield
    finally:
        holder.kill()
        await holder.wait()
        os.kill(pid, signal.SIGCONT)


if __name__ == "__main__":
    hold(int(sys.argv[1]), float(sys.argv[2]))
