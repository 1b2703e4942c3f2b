"""``goto``: point the mount somewhere, through the limits of the gateway that runs."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands

EXAMPLES = """\
Examples:
  mount-gateway goto 05:34:32 +22:00:52
  mount-gateway goto M42 --wait        until it is there; Ctrl-C stops it
  mount-gateway goto Jupiter
"""


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_wait, add_which
    from gateway.cli.mount.places import PLACES, add_place

    goto = commands.add_parser(
        "goto", help="point the mount to a place or an object, through the gateway that runs",
        description="Points the mount of the gateway that runs here to a place on the sky. The gateway's limits hold; "
                    "what it refuses is said in words, with exit code 1.",
        epilog=f"{EXAMPLES}\n{PLACES}",
    )  # fmt: skip
    add_place(goto)
    add_wait(goto)
    add_which(goto)
    goto.set_defaults(run=_goto)


def _goto(arguments: argparse.Namespace) -> int:
    from gateway.app.control import commands as wishes
    from gateway.cli.mount.asking import wish_for
    from gateway.cli.mount.places import place

    return wish_for(arguments, lambda number: wishes.Goto(number, place(arguments)), arguments.wait)
