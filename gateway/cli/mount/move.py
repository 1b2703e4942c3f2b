"""``move``: press an arrow for some seconds. It always ends: by its time, by Ctrl-C, or by the gateway's own clock."""

from __future__ import annotations

import argparse

from gateway.cli.help import Commands

DIRECTIONS = ("north", "south", "east", "west")
EXAMPLES = """\
Examples:
  mount-gateway move north --rate 2 --seconds 3
  mount-gateway move west --rate 9 --seconds 10     Ctrl-C stops it before its time
"""


def add(commands: Commands) -> None:
    from gateway.cli.mount.asking import add_which

    move = commands.add_parser(
        "move", help="move the mount north, south, east or west for some seconds",
        description="Presses an arrow of the mount of the gateway that runs here. The gateway itself releases it when "
                    "the time is over, whatever becomes of this command; Ctrl-C releases it at once.",
        epilog=EXAMPLES,
    )  # fmt: skip
    move.add_argument("direction", choices=DIRECTIONS, help="north, south, east or west, as on the sky")
    move.add_argument(
        "--rate",
        type=int,
        choices=range(1, 10),
        default=5,
        metavar="1-9",
        help="as the hand control's keys: 1 is slowest, 9 is fastest (5)",
    )
    move.add_argument("--seconds", type=float, default=1.0, metavar="S", help="for how long (1)")
    add_which(move)
    move.set_defaults(run=_move)


def _move(arguments: argparse.Namespace) -> int:
    from gateway.app.control.commands import Move
    from gateway.cli.mount.asking import ANSWERED, wish_for
    from gateway.core.errors import UserError
    from gateway.core.operations import Direction

    if not 0.0 < arguments.seconds <= 3600.0:
        raise UserError(f"--seconds {arguments.seconds:g}: write how long the arrow is pressed, like 3")
    direction, rate, lasting = Direction[arguments.direction.upper()], arguments.rate, arguments.seconds
    return wish_for(arguments, lambda number: Move(number, direction, rate, lasting), seconds=lasting + ANSWERED)
