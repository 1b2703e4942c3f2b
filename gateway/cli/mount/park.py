"""``park``: send the mount to its park position."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_wait, add_which

    park = commands.add_parser(
        "park", help="send the mount to its park position",
        description="Sends the mount of the gateway that runs here to its park position, where its tracking is off "
                    "(park of run says where that is).",
        epilog="Example:\n  mount-gateway park --wait\n",
    )  # fmt: skip
    add_wait(park)
    add_which(park)
    park.set_defaults(run=_park)


def _park(arguments: argparse.Namespace) -> int:
    from gateway.app.control.commands import Park
    from gateway.cli.mount.asking import wish_for

    return wish_for(arguments, Park, arguments.wait)
