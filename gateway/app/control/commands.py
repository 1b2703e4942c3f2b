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


class Numbered(Struct, frozen=True):
    """What all have in common: the number that was drawn for it."""

    number: str


class Base(Numbered, frozen=True, kw_only=True):
    """And who wishes, where that is not the command itself."""

    who: str = ""


class Goto(Base, frozen=True, tag="goto"):
    """Point there and track."""

    where: Where


class Sync(Base, frozen=True, tag="sync"):
    """It points there now."""

    where: Where


class Park(Base, frozen=True, tag="park"):
    """Go to the park position."""


class Home(Base, frozen=True, tag="home"):
    """Go to the home position."""


class Unpark(Base, frozen=True, tag="unpark"):
    """Take up service again."""


class Move(Base, frozen=True, tag="move"):
    """Press an arrow for some seconds, at the hand control's key 1 to 9."""

    direction: Direction
    key: int
    seconds: float


class Press(Base, frozen=True, tag="press"):
    """Press an arrow until it is let go. Said again, it only tells that somebody still holds it."""

    direction: Direction
    key: int


class LetGo(Base, frozen=True, tag="let go"):
    """Let go of the arrow that was pressed under this number."""


class Track(Base, frozen=True, tag="track"):
    """Tracking on or off; on, perhaps at another rate: ``sidereal``, ``lunar`` or ``solar``."""

    on: bool = True
    rate: str | None = None


class TellTime(Base, frozen=True, tag="time"):
    """What time it is: UTC as Unix seconds, and local time minus UTC in hours."""

    unix: float
    offset: float


class TellSite(Base, frozen=True, tag="site"):
    """Where the mount stands, degrees, north and east positive."""

    latitude: float
    longitude: float


class Follow(Base, frozen=True, tag="follow"):
    """How does it go with what was asked for?"""


class End(Base, frozen=True, tag="end"):
    """Take a request back: what it began is ended, and nothing else."""


class See(Struct, frozen=True, tag="see"):
    """Everything that is known of the mount."""


Wish = (
    Goto | Sync | Park | Home | Unpark | Move | Press | LetGo | Track | TellTime | TellSite | Follow | End | See
)  # fmt: skip


def written(wish: Wish) -> str:
    """A request as a line."""
    return json.dumps(msgspec.to_builtins(wish), separators=(",", ":"))


def read(line: str) -> Wish:
    """The request that a line is. Raises ValueError."""
    if not (line.isascii() and line.isprintable()):
        raise ValueError("a wish is plain text")
    wish: Wish = msgspec.json.decode(line, type=Wish)
    return wish
