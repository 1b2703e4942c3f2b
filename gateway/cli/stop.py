"""``stop``: end every motion of every mount here, with or without a running gateway.

One line for each mount; exit code 1 where one could not be stopped. Fit for systemd's ``ExecStopPost``.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from typing import Any

from gateway import journal


def add(commands: Any) -> None:
    """Put the command into the parser."""
    stop = commands.add_parser(
        "stop", help="stop the mount: of every running gateway, and of one that was killed",
        description="Ends every motion of every mount here. Exit code 0: none moves any more, 1: one could not be "
                    "stopped.",
        epilog="Examples:\n  mount-gateway stop\n"
               "  mount-gateway stop --state /var/lib/mount-gateway    of the gateway that systemd runs",
    )  # fmt: skip
    stop.add_argument("--mount", metavar="NAME", help="only this one: its endpoint, or the part behind @")
    stop.add_argument("--state", metavar="PATH", help="the directory that the gateway was told to keep its state in")
    stop.set_defaults(run=_stop)


def _stop(arguments: argparse.Namespace) -> int:
    from gateway.rescue import STOPPED, stop_all
    from gateway.state import directory

    outcomes = asyncio.run(stop_all(directory(arguments.state), arguments.mount))
    for mount, answer in outcomes:
        good = answer == STOPPED
        words = STOPPED if good else f"not stopped: {answer.removeprefix('failed ')}"
        stream, level = (sys.stdout, journal.INFO) if good else (sys.stderr, journal.ERROR)
        print(f"{journal.level(level, stream)}{mount or 'a mount that is not known any more'}: {words}", file=stream)
    if not outcomes:
        only = f" for {arguments.mount}" if arguments.mount else ""
        print(f"nothing to stop: no gateway runs{only}, and none ended in motion")
    return 0 if all(answer == STOPPED for _, answer in outcomes) else 1
