"""``goto``, ``sync``, ``move``, ``park``, ``unpark``: the user's requests to the mount, through the running gateway.

Each is one request to that gateway, whose limits apply; a refusal is explained, with exit code 1. Ctrl-C cancels the
request: the motion that it began is stopped. A target is two angles or the name of an object; angles are of the equinox
of date, as the mount and ``status`` show them, or with ``--j2000`` of J2000.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
from collections.abc import Callable
from typing import TypeAlias

from gateway.app.control.exchange import ControlEndpoint
from gateway.cli.command_line import Commands, Parser
from gateway.cli.mount import gateway_client
from gateway.cli.serve.signals import race
from gateway.core import requests
from gateway.core.errors import UserError
from gateway.core.operations import Direction
from gateway.protocols.wireformat import sexagesimal

#: A function that makes a request from the arguments of the command line. It raises UserError.
RequestFactory: TypeAlias = Callable[
    [argparse.Namespace],
    "requests.GotoRequest | requests.SyncRequest | requests.ParkRequest | requests.UnparkRequest"
    " | requests.MoveRequest",
]

GOTO_HELP = """\
Examples:
  mount-gateway goto 05:34:32 +22:00:52
  mount-gateway goto M42 --wait        until it has arrived; Ctrl-C stops it
  mount-gateway goto Jupiter
"""
MOVE_HELP = """\
Examples:
  mount-gateway move north --rate 2 --seconds 3
  mount-gateway move west --rate 9 --seconds 10     Ctrl-C stops it before its time
"""
DIRECTIONS = ("north", "south", "east", "west")
POSITION_HELP = """\
A place is RA DEC of date (--j2000: as in catalogues and maps), or the name of an object.
  05:34:32 +22:00:52     hours and degrees; 5h34m32s 22d00m52s, and fewer parts (05:34 22), are understood as well
  83.633 22.014          degrees both
  Moon Mercury Venus Mars Jupiter Saturn Uranus Neptune
  Polaris "alpha Ori" "61 Cyg" HIP32349      3,200 stars
  M42 NGC7000 IC434 C14 "Ring Nebula"        2,800 nebulae, clusters and galaxies; the rest of NGC, IC and UGC
      from the object library, which is installed apart: docs/programs.md
"""


def add_goto(commands: Commands) -> None:
    goto = commands.add_parser(
        "goto",
        description="Points the mount at a place on the sky, through the running gateway. If the gateway refuses, "
        "it says why, with exit code 1.",
        epilog=f"{GOTO_HELP}\n{POSITION_HELP}",
    )  # fmt: skip
    add_target_arguments(goto)
    _add_wait_flag(goto)
    _add_request(goto, lambda arguments: requests.GotoRequest(typed_target(arguments)))


def add_sync(commands: Commands) -> None:
    sync = commands.add_parser(
        "sync",
        description="Tells the mount, through the running gateway, where it points now: centre an object first. The "
        "gateway refuses a sync while the mount moves, and one too far away (--sync-limit of run).",
        epilog=f"Example:\n  mount-gateway sync HIP32349\n\n{POSITION_HELP}",
    )  # fmt: skip
    add_target_arguments(sync)
    _add_request(sync, lambda arguments: requests.SyncRequest(typed_target(arguments)))


def add_move(commands: Commands) -> None:
    move = commands.add_parser(
        "move",
        description="Presses an arrow of the mount, through the running gateway. The gateway releases it when the "
        "time is over, even if this command was killed. Ctrl-C releases it at once.",
        epilog=MOVE_HELP,
    )  # fmt: skip
    move.add_argument(
        "direction",
        choices=DIRECTIONS,
        help="north, south, east or west, as on the sky; on an alt-az mount north is up",
    )
    move.add_argument(
        "--rate",
        type=int,
        choices=range(1, 10),
        default=5,
        metavar="1-9",
        help="as the hand control's keys: 1 is slowest, 9 is fastest (5)",
    )
    move.add_argument("--seconds", type=float, default=1.0, metavar="S", help="for how long (1)")
    _add_request(move, _move_request)


def add_park(commands: Commands) -> None:
    park = commands.add_parser(
        "park",
        description="Sends the mount, through the running gateway, to its park position, and turns tracking off "
        "there (--park of run sets it).",
        epilog="Example:\n  mount-gateway park --wait\n",
    )  # fmt: skip
    _add_wait_flag(park)
    _add_request(park, lambda _: requests.ParkRequest())


def add_unpark(commands: Commands) -> None:
    unpark = commands.add_parser(
        "unpark",
        description="Lets a parked mount track again, through the running gateway.",
        epilog="Example:\n  mount-gateway unpark\n",
    )  # fmt: skip
    _add_request(unpark, lambda _: requests.UnparkRequest())


def _add_wait_flag(command: Parser) -> None:
    command.add_argument("--wait", action="store_true", help="wait until it has arrived; Ctrl-C stops it")


def _add_request(command: Parser, make_request: RequestFactory) -> None:
    """Add the flags that choose a gateway, and let the command send the request that ``make_request`` returns."""
    gateway_client.add_gateway_flags(command)
    command.set_defaults(run=lambda arguments: _send_request(arguments, make_request), wait=False)


def _move_request(arguments: argparse.Namespace) -> requests.MoveRequest:
    if not 0.0 < arguments.seconds <= 3600.0:
        raise UserError(f"--seconds {arguments.seconds:g}: write how long the arrow is pressed, like 3")
    return requests.MoveRequest(Direction[arguments.direction.upper()], arguments.rate, arguments.seconds)


def _send_request(arguments: argparse.Namespace, make_request: RequestFactory) -> int:
    """Send the request, and follow it to its end with ``--wait``; Ctrl-C cancels it. Return the exit code."""
    from gateway.app.control.reach import ANSWER_TIMEOUT
    from gateway.app.control.reach import send_request as send

    request = make_request(arguments)
    lasting = request.seconds if isinstance(request, requests.MoveRequest) else 0.0

    async def work(endpoint: ControlEndpoint, interrupted: asyncio.Event) -> int:
        answer = await race(interrupted, send(endpoint, request, lasting + ANSWER_TIMEOUT))
        if answer is not None and answer.is_ok and arguments.wait:
            if sys.stdout.isatty():
                gateway_client.print_answer(answer)
            answer = await _follow_request(endpoint, request.number, interrupted)
        if answer is not None:
            return gateway_client.print_answer(answer)
        gateway_client.print_answer(await send(endpoint, requests.CancelRequest(request.number)))
        return 1

    return gateway_client.run_with_gateway(arguments, work)


async def _follow_request(endpoint: ControlEndpoint, number: str, interrupted: asyncio.Event) -> requests.Answer | None:
    """Return the final result of a request, or None after Ctrl-C. Meanwhile a line on the terminal shows progress."""
    from gateway.app.control.reach import send_request as send
    from gateway.cli.serve.live import Screen, find_terminal

    screen = Screen(find_terminal())
    request = requests.ProgressRequest(number)
    try:
        while True:
            answer = await race(interrupted, send(endpoint, request))
            if answer is None or answer.outcome != requests.UNDER_WAY:
                return answer
            screen.show_status(str(answer))
            if await gateway_client.cancelled_while_waiting(interrupted):
                return None
    finally:
        screen.clear()


def add_target_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments for a target on the sky."""
    command.add_argument("place", nargs="+", metavar="PLACE", help="RA DEC, or the name of an object: see below")
    command.add_argument("--j2000", action="store_true", help="RA and DEC are J2000, as in catalogues")


def typed_target(arguments: argparse.Namespace) -> requests.ResolvedTarget:
    """Return the target that the user typed. Raises UserError with the correct form if it is mistyped."""
    parts = [word.strip() for word in arguments.place]
    if len(parts) != 2 or not parts[0][:1].isdecimal() or parts[1][:1].isalpha():
        from gateway.app.control import objects  # loads the catalogues, which only names of objects need

        try:
            return objects.find_target(" ".join(parts))
        except objects.LibraryMissing as missing:
            raise UserError(f"{missing}. To install it, {missing.remedy}") from None
    ra, dec = parts
    degrees = ":" not in ra and "h" not in ra.lower()
    right = _parse_angle(ra, "a right ascension", 360.0 if degrees else 24.0, 0.0)
    up = _parse_angle(dec, "a declination", 90.0, -90.0)
    return requests.Spot(right if degrees else right * 15.0, up, arguments.j2000)


def _parse_angle(text: str, quantity: str, maximum: float, minimum: float) -> float:
    """Parse an angle; return it in hours or degrees, as it was typed. Raises UserError."""
    try:
        value = sexagesimal.parse_typed_angle(text)
    except ValueError:
        raise UserError(f"{text!r} is not {quantity}: write it like 05:34:32, or in degrees like 83.63") from None
    if not minimum <= value <= maximum:
        raise UserError(f"{text!r} is not {quantity}: it is from {minimum:g} to {maximum:g}")
    return value
