"""The memory of the gateway: when it gives its first answer, and while it serves many programs."""

from __future__ import annotations

from pathlib import Path

GOAL_EARLY = 45.0
GOAL_STEADY = 60.0


def resident(pid: int) -> float:
    """Return the resident memory of a process in MiB (VmRSS of Linux)."""
    for line in Path(f"/proc/{pid}/status").read_text("ascii").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024.0
    raise RuntimeError(f"process {pid} has ended")
