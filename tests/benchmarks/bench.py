"""``python tests/benchmarks/bench.py [--quick] [--json FILE]``: speed, line load and memory, against minimal programs.

It takes under six minutes, with ``--quick`` under two minutes, and needs Linux. README.md here explains the figures.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import line_load
import processes
import round_trip
import starting
from figures import Figure, table

#: Calculates the tables of the next days.
ALMANAC = """
import time
from gateway.astro.ephemeris import keeper
today = int(time.time() // 86400.0)
keeper.renewed(range(today, today + keeper.DAYS_PER_CALCULATION))
"""


def main() -> int:
    """Measure and print; return 0 even if a goal is missed, because that depends on the machine too."""
    parser = argparse.ArgumentParser(description="Measure the gateway on this machine.")
    parser.add_argument("--quick", action="store_true", help="fewer rounds: under two minutes")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to a file, too")
    arguments = parser.parse_args()
    if sys.platform != "linux":
        parser.error("the measurements read /proc and keep processes on one core: they need Linux")
    began = time.monotonic()
    figures: list[Figure] = []
    with tempfile.TemporaryDirectory(prefix="mount-gateway-bench-") as bytecode:
        # Now: otherwise a process of the first gateway would calculate it while that is measured.
        sky = [sys.executable, "-c", ALMANAC]
        subprocess.run(sky, cwd=processes.ROOT, env=processes.environment(bytecode), check=True)
        for part in (starting, round_trip, line_load):
            figures += part.measure(bytecode, arguments.quick)
    machine = (
        f"{platform.machine()}, {os.cpu_count()} cores, Linux {platform.release()}, Python {platform.python_version()}"
    )
    print(table(figures))
    print(f"\n{machine}; measured in {time.monotonic() - began:.0f} s")
    if arguments.json:
        rows = [{**figure._asdict(), "ratio": figure.ratio, "met": figure.met} for figure in figures]
        arguments.json.write_text(json.dumps({"machine": machine, "figures": rows}, indent=1) + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
