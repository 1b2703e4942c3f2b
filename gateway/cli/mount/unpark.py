"""``unpark``: have a parked mount track again, or wake one that hibernates."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_which

    unpark = commands.add_parser(
        "unpark", help="take a parked mount up again: it tracks",
        description="Takes the mount of the gateway that runs here up again: it tracks from now on.",
        epilog="Example:\n  mount-gateway unpark\n",
    )  # fmt: skip
    add_which(unpark)
    unpark.set_defaults(run=_unpark)


def _unpark(arguments: argparse.Namespace) -> int:
    from gateway.app.control.commands import Unpark
    from gateway.cli.mount.asking import wish_for

    return wish_for(arguments, Unpark)
