"""Detects every simulated mount at every baud rate, on pseudo-terminals in real time, and measures how long it takes.

    python tests/soak/detect_matrix.py [--latency 0.1] [--at-once 8] [WORD ...]

It prints a line per mount and rate; exit code 1 if one was not found or took too long. With words, it tries only
mounts whose names contain one of them. Hand controls use 9600 baud only, so they are tried at no other rate.
"""

from __future__ import annotations

import argparse
import asyncio
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

from gateway.app.config import Endpoint
from gateway.app.simulated import make_simulator, serve_simulator
from gateway.diagnostics.detect import SerialPortInfo, look
from gateway.diagnostics.detect.scan_port import OTHERS, USUAL
from gateway.protocols.nexstar.versions import made_with
from gateway.protocols.wireformat.command_set import load

#: Seconds permitted per port: at 9600 baud, and at every other rate.
AT_9600, ELSEWHERE = 5.0, 25.0


class Case(NamedTuple):
    """One simulated mount at one baud rate."""

    protocol: str
    model: str
    version: str | None
    rate: int

    def __str__(self) -> str:
        version = f"/{self.version}" if self.version else ""
        return f"{self.protocol}:{self.model}{version} at {self.rate}"


def cases() -> list[Case]:
    """Return every Meade at every rate, and every hand control in every version it was sold with."""
    rates = sorted({USUAL, *OTHERS})
    found = [Case("lx200", model, None, rate) for model in load("lx200").models for rate in rates]
    for model, row in load("nexstar").models.items():
        found += [Case("nexstar", model, version, USUAL) for version in made_with(row)]
    return found


async def measure(case: Case, folder: Path, latency: float) -> bool:
    """Detect the mount on one port, print the result, and return whether it was right and in time."""
    endpoint = Endpoint(case.protocol, "-", case.model, case.version)
    simulator: Any = make_simulator(endpoint, clock=time.time)
    path = folder / f"{case.protocol}-{case.model}-{case.version}-{case.rate}"
    ports = await serve_simulator(simulator, [f"pty:{path}"], latency, case.rate)
    finding = await look(SerialPortInfo(str(path), str(path)))
    for port in ports:
        await port.close()
    limit = AT_9600 if case.rate == USUAL else ELSEWHERE
    right = finding.mount is not None and finding.mount.protocol == case.protocol and finding.baud == case.rate
    words = "ok" if right and finding.seconds < limit else "TOO SLOW" if right else f"NOT FOUND: {finding.state}"
    print(f"{case!s:<44} {finding.seconds:6.2f} s  {words}", flush=True)
    return words == "ok"


async def main() -> int:
    """Run all cases and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--latency", type=float, default=0.1, help="seconds that a mount takes to answer")
    parser.add_argument("--at-once", type=int, default=8, help="ports to try at the same time")
    parser.add_argument("word", nargs="*", help="mounts whose names contain one of these")
    arguments = parser.parse_args()
    chosen = [case for case in cases() if not arguments.word or any(word in str(case) for word in arguments.word)]
    places = asyncio.Semaphore(arguments.at_once)
    with tempfile.TemporaryDirectory() as folder:

        async def one(case: Case) -> bool:
            async with places:
                return await measure(case, Path(folder), arguments.latency)

        well = await asyncio.gather(*(one(case) for case in chosen))
    print(f"{sum(well)} of {len(well)} as they should be")
    return 0 if all(well) else 1


if __name__ == "__main__":
    raise SystemExit(asyncio.run(main()))
