"""Taps on an arrow, of every length over every line on every mount, by LX200, NexStar and Alpaca programs.

    python -m tests.soak.taps

Each must move the mount, by its true axes, between half of what the same tap at its own keypad does, and that plus what
the line needs. Exit code 1 if one does not.
"""

from __future__ import annotations

import sys

from gateway.diagnostics.virtual_time import run
from tests.support.taps import FACES, LATENCIES, LENGTHS, MOUNTS, judged


def main() -> int:
    wrong = count = 0
    for face in FACES:
        for mount in MOUNTS:
            for latency in LATENCIES:
                for seconds in LENGTHS:
                    count += 1
                    if why := run(judged(face, mount, seconds, latency)):
                        wrong += 1
                        print(f"{face} {mount} line {latency} s, tap {seconds} s: {why}", flush=True)
    print(f"{count} taps, {wrong} moved too little or too far")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
