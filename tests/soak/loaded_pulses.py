"""Guide pulses that the gateway times itself, on a computer that is too busy. Standalone; takes real time.

    python -m tests.soak.loaded_pulses [--load 20] [--pulses 100] [--ms 1000]

Real processes: a simulated CPC, whose motors have no pulses, tracks in alt-az; a program sends pulses in all directions
while so many processes compute without a pause, at most a minute at a time. The mount and the measurement have a higher
priority (as root), as a mount has a processor of its own. Each pulse is measured at the true axes, beyond tracking: 95
of 100 must be within 10 %, less what an earlier one of that axis was too long, and none may be too long by more than an
exchange and the time for which the gateway waited for a processor.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from gateway.astro.spherical import SIDEREAL_RATE, horizon_to_hour_angle, hour_angle_to_horizon, wrap180
from tests.support.process import WHOLE, Running

SITE = (45.0, 10.0)
#: Degrees a second of a pulse; letter -> axis and sign; seconds of one exchange; of load at a time, and between.
RATE, LETTERS, EXCHANGE = 0.5 * SIDEREAL_RATE, {"n": (2, 1), "e": (1, -1), "s": (2, -1), "w": (1, 1)}, 0.1
LOADED, BETWEEN = 50.0, 20.0


class Measured(NamedTuple):
    """One pulse: seconds that were asked for and that the motor's turn took, and that the gateway waited meanwhile."""

    letter: str
    asked: float
    took: float
    waited: float


@contextlib.contextmanager
def load(processes: int) -> Iterator[None]:
    """Keep the processors busy within the block."""
    compute = ["timeout", "60", "sh", "-c", "while :; do :; done"]
    busy = [
        subprocess.Popen(compute, preexec_fn=lambda: os.setpriority(os.PRIO_PROCESS, 0, 0)) for _ in range(processes)
    ]
    try:
        yield
    finally:
        for one in busy:
            one.terminate()
        for one in busy:
            one.wait()


def prefer(process: int) -> None:
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, process, -20)


def waited(process: int) -> float:
    """Return the seconds that a process has waited for a processor."""
    return int(Path(f"/proc/{process}/schedstat").read_text().split()[1]) / 1e9


class Rig:
    """The simulated mount, the gateway and the program."""

    def __init__(self, place: Path, options: list[str]) -> None:
        self.truth = place / "truth.jsonl"
        mount = ("nexstar:cpc/4.21", "--at", "tcp://127.0.0.1:0", "--site", "45,10", "--latency", "0.02")
        self.sim = Running("sim", *mount, "--truth", str(self.truth), by=WHOLE)
        where = self.sim.ready().replace("tcp", "socket")
        surface = ("--surface", "lx200@tcp://127.0.0.1:0", "--state", str(place), "--sun", "0", *options)
        self.gateway = Running("run", "--mount", f"nexstar@{where}", *surface, by=WHOLE)
        host, _, port = self.gateway.ready().removeprefix("tcp://").partition(":")
        self.program = socket.create_connection((host, int(port)), 20)
        for process in (self.sim.process.pid, os.getpid()):
            prefer(process)

    def settle(self) -> None:
        """Wait until the gateway has loaded what it loads in the background."""
        spent = -1.0
        while (now := self._spent()) - spent > 0.2:
            spent = now
            time.sleep(5.0)

    def _spent(self) -> float:
        fields = Path(f"/proc/{self.gateway.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def row(self) -> dict[str, float]:
        """Return the next sample of the truth."""
        size = self.truth.stat().st_size
        while self.truth.stat().st_size <= size:
            time.sleep(0.02)
        time.sleep(0.02)
        with self.truth.open("rb") as file:
            file.seek(-2000, os.SEEK_END)
            found: dict[str, float] = json.loads(file.read().split(b"\n")[-2])
        return found

    def pulse(self, letter: str, ms: int) -> Measured:
        axis, sign = LETTERS[letter]
        before, began = self.row(), waited(self.gateway.process.pid)
        self.program.sendall(f":Mg{letter}{ms:04d}#".encode())
        time.sleep(ms / 1000.0 + 2.0)
        after = self.row()
        hour_angle, dec = horizon_to_hour_angle(before["azimuth"], before["altitude"], SITE[0])
        tracked = hour_angle_to_horizon(hour_angle + SIDEREAL_RATE * (after["t"] - before["t"]), dec, SITE[0])
        moved = wrap180(after[f"axis{axis}"] - tracked[axis - 1]) * sign / RATE
        return Measured(letter, ms / 1000.0, moved, waited(self.gateway.process.pid) - began)

    def end(self) -> str:
        self.program.close()
        self.gateway.end()
        self.sim.end()
        return self.gateway.said


def judge(pulses: list[Measured]) -> tuple[int, int]:
    """Return how many pulses were within 10 %, and how many too long for no reason; print them."""
    owed: dict[int, tuple[int, float]] = {}
    good = long = 0
    for one in pulses:
        axis, sign = LETTERS[one.letter]
        before, excess = owed.get(axis, (sign, 0.0))
        right = one.asked - (max(0.0, excess) if before == sign else 0.0)
        owed[axis] = sign, one.took - right
        within = min(abs(one.took - right), abs(one.took - one.asked)) <= 0.1 * one.asked
        without_reason = one.took - one.asked > EXCHANGE + one.waited
        good, long = good + within, long + without_reason
        if not within or without_reason:
            print(
                f"  {one.letter}: {one.took:.3f} s for {one.asked:.3f} s, {one.took - right:+.3f} s beyond what was "
                f"due; the gateway waited {one.waited:.3f} s" + (" TOO LONG" if without_reason else "")
            )
    return good, long


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--load", type=int, default=20)
    parser.add_argument("--pulses", type=int, default=100)
    parser.add_argument("--ms", type=int, default=1000)
    parser.add_argument("--said", action="store_true", help="print what the gateway logged")
    arguments = parser.parse_args()
    pulses: list[Measured] = []
    with tempfile.TemporaryDirectory() as place:
        rig = Rig(Path(place), ["--log=all"] if arguments.said else [])
        try:
            rig.settle()
            while len(pulses) < arguments.pulses:
                with load(arguments.load):
                    end = time.monotonic() + LOADED
                    while time.monotonic() < end and len(pulses) < arguments.pulses:
                        letter = "nnessww"[len(pulses) % 7]
                        pulses.append(rig.pulse(letter, arguments.ms))
                if len(pulses) < arguments.pulses:
                    time.sleep(BETWEEN)
        finally:
            said = rig.end()
    good, long = judge(pulses)
    lengths = sorted(one.took / one.asked for one in pulses)
    middle = lengths[len(lengths) // 2]
    print(f"shortest {lengths[0]:.3f}, median {middle:.3f}, longest {lengths[-1]:.3f} of what was asked")
    if arguments.said:
        print(said)
    told = [line for line in said.splitlines() if "pulse" in line]
    print(f"{good} of {len(pulses)} within 10 %, {long} too long for no reason; the log tells of {len(told)}")
    return 0 if good >= 0.95 * len(pulses) and not long else 1


if __name__ == "__main__":
    sys.exit(main())
