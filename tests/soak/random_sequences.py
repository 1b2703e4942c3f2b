"""Random sequences for as long as you like: ``python -m tests.soak.random_sequences --minutes 10``.

Every play has a seed, which determines everything: mount, version, presented model, site, time, and every byte sent.
A play with complaints is printed with its seed; the same seed repeats it, and ``--said`` prints what was sent.
With ``--by-hand`` the plays are manual motions near a limit; with ``--contradicting`` sources of site and time are
wrong, and the tube is judged by the true ones.
"""

from __future__ import annotations

import argparse
import logging
import time
from collections import Counter

from tests.property import random_by_hand
from tests.property.random_play import cast, play


def main() -> int:
    """Return 0 if no play has complaints, else 1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0, help="the first seed")
    parser.add_argument("--plays", type=int, default=10**9, help="stop after this many")
    parser.add_argument("--steps", type=int, default=80, help="in each play")
    parser.add_argument("--by-hand", action="store_true", help="arrows and motors near a limit, and nothing else")
    parser.add_argument("--contradicting", action="store_true", help="sources of site and time contradict each other")
    parser.add_argument("--said", action="store_true", help="print what was sent")
    arguments = parser.parse_args()
    logging.disable()
    ends = time.monotonic() + 60.0 * arguments.minutes
    total: Counter[str] = Counter()
    worst: Counter[str] = Counter()
    for seed in range(arguments.seed, arguments.seed + arguments.plays):
        if time.monotonic() > ends:
            break
        done = (
            random_by_hand.play(seed)
            if arguments.by_hand
            else play(seed, arguments.steps, *cast(seed), arguments.contradicting)
        )
        total.update(plays=1, steps=done.steps, looks=done.looks, commanded=done.commanded, bad=bool(done.complaints))
        for limit, degrees in done.worst.items():
            worst[limit] = max(worst[limit], degrees)  # type: ignore[assignment]
        if done.complaints:
            print(done.name, *done.complaints[:8], sep="\n    ", flush=True)
        if arguments.said:
            print(*done.said, sep="\n")
    print(", ".join(f"{count} {name}" for name, count in total.items()))
    print("farthest beyond a limit, degrees:", ", ".join(f"{name} {worst[name]:.2f}" for name in worst))
    return int(total["bad"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
