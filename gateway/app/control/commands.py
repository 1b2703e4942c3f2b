"""The requests that a person makes on the command line, as they travel to the gateway that carries them out.

A request is one line of plain ASCII, so that a recording can hold it. Angles are degrees. ``number`` is drawn by the
command that asks; with it the same person follows the request and cancels it.
"""

from __future__ import annotations

import json

import msgspec
from msgspec import Struct

from gateway.core.operations import Direction


class Spot(Struct, frozen=True, tag="spot"):
    """A place on the sky: of date, or as catalogues count (``j2000``)."""

    ra: float
    dec: float
    j2000: bool = False


class Body(Struct, frozen=True, tag="body"):
    """A planet by its English name, or the Moon: only the gateway knows where it stands."""

    name: str


Where = Spot | Body


class Goto(Struct, frozen=True, tag="goto"):
    """Point there and track."""

    number: str
    where: Where


class Sync(Struct, frozen=True, tag="sync"):
    """It points there now."""

    number: str
    where: Where


class Park(Struct, frozen=True, tag="park"):
    """Go to the park position."""

    number: str


class Unpark(Struct, frozen=True, tag="unpark"):
    """Take up service again."""

    number: str


class Move(Struct, frozen=True, tag="move"):
    """Press an arrow for some seconds, at the hand control's key 1 to 9."""

    number: str
    direction: Direction
    key: int
    seconds: float


class Follow(Struct, frozen=True, tag="follow"):
    """How does it go with what was asked for?"""

    number: str


class End(Struct, frozen=True, tag="end"):
    """Take a request back: what it began is ended, and nothing else."""

    number: str


class See(Struct, frozen=True, tag="see"):
    """Everything that is known of the mount."""


Wish = Goto | Sync | Park | Unpark | Move | Follow | End | See


def written(wish: Wish) -> str:
    """A request as a line."""
    return json.dumps(msgspec.to_builtins(wish), separators=(",", ":"))


def read(line: str) -> Wish:
    """The request that a line is. Raises ValueError."""
    if not (line.isascii() and line.isprintable()):
        raise ValueError("a wish is plain text")
    wish: Wish = msgspec.json.decode(line, type=Wish)
    return wish
