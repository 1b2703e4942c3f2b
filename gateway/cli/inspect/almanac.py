"""``almanac``: calculates tables of the sky with astropy, for a file or for the gateway that started this process.

For a gateway it runs at low priority, and ends when that gateway ends or is killed.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import threading
import time
from pathlib import Path

from gateway.cli.command_line import Commands
from gateway.core.errors import UserError, explain_file_error
from gateway.system.files import replace_file


def add_almanac(commands: Commands) -> None:
    command = commands.add_parser(
        "almanac",
        description="Calculates tables of the sky with astropy, from today on, and writes them to a file for run "
                    "--almanac FILE. A gateway does this by itself where astropy is installed.",
        epilog="Example:\n  mount-gateway almanac year.almanac --days 400\n",
    )  # fmt: skip
    command.add_argument("file", metavar="FILE", help="the file to write, 2.7 kB for each day")
    command.add_argument("--days", metavar="DAYS", type=int, default=40, help="how many days (default: 40)")
    command.add_argument("--dates", help=argparse.SUPPRESS)
    command.set_defaults(run=_run_almanac)


def _run_almanac(arguments: argparse.Namespace) -> int:
    from gateway.astro.ephemeris.almanac import DAY
    from gateway.astro.offline import go_offline

    for_gateway = arguments.dates is not None
    if for_gateway:
        with contextlib.suppress(OSError, AttributeError):  # not on Windows
            os.nice(19)
        threading.Thread(target=_exit_when_gateway_ends, daemon=True).start()
        days = [int(day) for day in arguments.dates.split(",") if day]
    else:
        if not 1 <= arguments.days <= 2000:
            raise UserError("--days: write a number from 1 to 2000")
        today = int(time.time() // DAY)
        days = list(range(today, today + arguments.days))
    try:
        go_offline()
        from gateway.astro.ephemeris import by_astropy
    except ImportError as error:
        raise UserError(f"astropy cannot be used here: {error}") from None
    data = by_astropy.calculate_almanac(days).encode()
    if for_gateway:
        sys.stdout.buffer.write(data)
    else:
        try:
            replace_file(Path(arguments.file), data)
        except OSError as error:
            raise UserError(explain_file_error(arguments.file, error)) from None
        print(f"wrote {arguments.file}: {len(days)} days, {len(data) / 1e3:.0f} kB")
    return 0


def _exit_when_gateway_ends() -> None:
    """Wait until stdin is closed, which shows that the gateway that started this process has ended; then exit."""
    os.read(0, 1)
    os._exit(1)
