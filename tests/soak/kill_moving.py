"""Kill a gateway at random instants around the beginning of a motion, and start it again. Standalone.

    python -m tests.soak.kill_moving [--kills 40] [--seed 1]

Real processes: a simulated mount, a gateway in front of it, a client that holds a direction key. If a gateway leaves
the mount moving, it must have left a motion marker; after the next start the mount must stand still and track.
"""

from __future__ import annotations

import argparse
import random
import signal
import socket
import sys
import tempfile
import time
from pathlib import Path

from tests.integration.stops.test_shutdown import Moving
from tests.support.process import Running

#: Seconds: before the motor turns, a fast manual motion takes some exchanges, one of which turns tracking off.
LONGEST = 0.2


def _kill_once(moving: Moving, chance: random.Random) -> tuple[bool, bool, bool]:
    """Return whether the mount was left moving, whether a marker was there, and whether the next start stopped it."""
    host, _, port = moving.where.removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port))) as client:
        client.sendall(b":RS#:Mn#")
        time.sleep(chance.uniform(0.0, LONGEST))
        moving.gateway.end(signal.SIGKILL)
    left, marked = moving.moves(), any(moving.state.glob("*.moving"))
    moving.begin()
    return left, marked, moving.rests() and moving.tracking()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    started: list[Running] = []
    try:
        with tempfile.TemporaryDirectory() as place:
            moving = Moving(started, Path(place))
            runs = [_kill_once(moving, chance) for _ in range(arguments.kills)]
            moving.gateway.end()
    finally:
        for one in started:
            if one.process.poll() is None:
                one.process.kill()
                one.process.wait()
    unmarked = sum(left and not marked for left, marked, _ in runs)
    wrong = sum(not right for _, _, right in runs)
    print(
        f"seed {arguments.seed}: {len(runs)} kills, the mount left moving {sum(run[0] for run in runs)} times, "
        f"{unmarked} of them without a mark; {wrong} times not standing and tracking after the next start"
    )
    return 1 if unmarked or wrong or not any(run[0] for run in runs) else 0


if __name__ == "__main__":
    sys.exit(main())
