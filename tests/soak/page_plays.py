"""Random plays with three pages of the console over slow networks: no finger, no motion.

    python -m tests.soak.page_plays [--plays 500] [--first 0]

Prints each play in which the mount moved although no finger was on an arrow; exit code 1 if there is one.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter

from gateway.app.gateway import Gateway
from gateway.diagnostics.virtual_time import run
from tests.support.console.browser import node
from tests.support.console.plays import DELAYS, JITTERS, play
from tests.support.taps import MOUNTS

LATENCIES = (0.02, 0.1, 0.3)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plays", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="the seed of the first play")
    asked = parser.parse_args()
    Gateway.names = lambda self: ["lx200@tcp://127.0.0.1:4030"]  # type: ignore[method-assign]  # it has no port
    words: Counter[str] = Counter()
    bad, moved, mounts = 0, 0.0, list(MOUNTS)
    with node() as scripts:
        for seed in range(asked.first, asked.first + asked.plays):
            delay, jitter = DELAYS[seed % 5], JITTERS[seed // 5 % 2]
            mount, latency = mounts[seed // 10 % 4], LATENCIES[seed // 40 % 3]
            outcome = run(play(scripts, seed, delay, jitter, mount, latency))
            moved += outcome.moved
            words.update(outcome.words)
            if outcome.run_away:
                bad += 1
                print(
                    f"play {seed}: {mount}, line {latency} s, network {delay} s: {outcome.run_away:.1f} s", flush=True
                )
    for text, count in words.most_common():
        print(f"{count:5} {text}")
    print(f"{asked.plays} plays, {moved:.0f} s of motion, {bad} with motion without a finger")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
