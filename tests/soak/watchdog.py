"""Make gateways fail during a motion and measure how soon the mount stands still. Standalone.

    python -m tests.soak.watchdog [--times 3]

Real processes: a simulated mount that records its true axes, a gateway in front of it on a TCP line or a
pseudo-terminal, and a client that holds a direction key at the fastest rate. The gateway is killed, frozen, made to
quit, or its event loop is blocked. The output is the seconds from there until the axes only track, the memory of the
watchdog process, and its processor time in ten seconds of rest and of motion.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

from tests.support.process import Running
from tests.support.watchdog import FAILURES, Watched

#: Permitted seconds until rest, and the watchdog's memory in MiB.
REST, MEMORY = 3.0, 10.0
#: Degrees a second above which an axis does not only track.
TURNING = 0.02


def _seconds_to_rest(watched: Watched, failure: str, truth: Path) -> float:
    """Return the seconds by the mount's true axes, which are written ten times a second."""
    before = len(truth.read_text().splitlines())
    watched.inflict(failure)
    time.sleep(2.5)
    rows = [json.loads(line) for line in truth.read_text().splitlines()[before:]]
    turning = [row["t"] for row in rows if max(abs(row["rate1"]), abs(row["rate2"])) > TURNING]
    return float(turning[-1] - rows[0]["t"]) + 0.1 if turning else 0.0


def _memory(number: int) -> float:
    """Return the resident memory in MiB."""
    words = Path(f"/proc/{number}/status").read_text().split()
    return int(words[words.index("VmRSS:") + 1]) / 1024


def _processor(number: int) -> float:
    """Return the processor seconds so far."""
    fields = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _figures() -> tuple[float, float, float]:
    """Return memory, processor seconds in ten seconds of rest, and in ten of motion."""
    started: list[Running] = []
    with tempfile.TemporaryDirectory() as place:
        watched = Watched(started, Path(place), "nexstar", "tcp")
        number = watched.watchdog()
        assert number is not None
        at_first = _processor(number)
        time.sleep(10)
        at_rest = _processor(number) - at_first
        watched.move()
        time.sleep(10.0)
        figures = _memory(number), at_rest, _processor(number) - at_first - at_rest
        _end(watched, started)
    return figures


def _end(watched: Watched, started: list[Running]) -> None:
    watched.close()
    for one in started:
        one.end(signal.SIGKILL)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=3)
    arguments = parser.parse_args()
    worst = 0.0
    for kind in ("nexstar", "lx200"):
        for port in ("tcp", "pty"):
            for failure in FAILURES:
                seconds = []
                for _ in range(arguments.times):
                    started: list[Running] = []
                    with tempfile.TemporaryDirectory() as place:
                        truth = Path(place) / "truth.jsonl"
                        watched = Watched(started, Path(place), kind, port, truth)
                        watched.move()
                        seconds.append(_seconds_to_rest(watched, failure, truth))
                        _end(watched, started)
                worst = max(worst, *seconds)
                print(
                    f"{kind:<8} {port:<4} {failure:<8} at rest after {' '.join(f'{one:.1f}' for one in seconds)} s",
                    flush=True,
                )
    memory, resting, moving = _figures()
    print(f"watchdog process: {memory:.1f} MiB; processor {resting:.2f} s in 10 s of rest, {moving:.2f} s in motion")
    good = worst <= REST and memory <= MEMORY and resting <= 0.01
    print(f"worst {worst:.1f} s (allowed {REST}): {'as it should be' if good else 'NOT as it should be'}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
