"""What people and programs ask of a gateway: from a page, a broker, a shell or Python, in one vocabulary.

A request is one line of plain ASCII JSON, so that a recording can hold it. Angles are in degrees. The sender draws
``number`` at random; with it, it follows the request later, or cancels it.
"""

from __future__ import annotations

import json

import msgspec
from msgspec import Struct

from gateway.core.operations import Direction


class Spot(Struct, frozen=True, tag="spot"):
    """A position on the sky in degrees, of the equinox of date or of J2000."""

    ra: float
    dec: float
    j2000: bool = False


class Body(Struct, frozen=True, tag="body"):
    """A planet by its English name, or the Moon: the gateway computes its position."""

    name: str


Where = Spot | Body


class Numbered(Struct, frozen=True):
    """What all requests about motions and settings have in common: a number."""

    number: str


class Base(Numbered, frozen=True, kw_only=True):
    """A request that does something; ``who`` asks for it, empty for the command itself."""

    who: str = ""


class Goto(Base, frozen=True, tag="goto"):
    """Slew to a target and track it."""

    where: Where


class Sync(Base, frozen=True, tag="sync"):
    """Tell the mount that it points at this target now."""

    where: Where


class Park(Base, frozen=True, tag="park"):
    """Go to the park position."""


class Home(Base, frozen=True, tag="home"):
    """Go to the home position."""


class Unpark(Base, frozen=True, tag="unpark"):
    """Unpark the mount, or wake it, so that it tracks."""


class Move(Base, frozen=True, tag="move"):
    """Move by hand for some seconds, at the rate of the hand control's key 1 to 9."""

    direction: Direction
    key: int
    seconds: float


class Press(Base, frozen=True, tag="press"):
    """Move by hand until ``LetGo``. Repeating the request keeps the motion alive (dead man's switch)."""

    direction: Direction
    key: int


class LetGo(Base, frozen=True, tag="let go"):
    """End the motion that ``Press`` began under this number. One that has not begun is a tap; ``lost`` drops it."""

    lost: bool = False


class Track(Base, frozen=True, tag="track"):
    """Turn tracking on or off; optionally set the rate: ``sidereal``, ``lunar`` or ``solar``."""

    on: bool = True
    rate: str | None = None


class TellTime(Base, frozen=True, tag="time"):
    """Set the mount's clock: UTC as Unix seconds, and local time minus UTC in hours."""

    unix: float
    offset: float


class TellSite(Base, frozen=True, tag="site"):
    """Set the mount's site in degrees, north and east positive."""

    latitude: float
    longitude: float


class Follow(Base, frozen=True, tag="follow"):
    """Ask for the progress of the request with this number."""


class End(Base, frozen=True, tag="end"):
    """Cancel the request with this number: end the motion that it began, and no other."""


class See(Struct, frozen=True, tag="see"):
    """Ask for everything that is known of the mount (a ``State``); unless ``fresh`` without asking the mount."""

    fresh: bool = True


Request = (
    Goto | Sync | Park | Home | Unpark | Move | Press | LetGo | Track | TellTime | TellSite | Follow | End | See
)  # fmt: skip


def encode(request: Request) -> str:
    """Encode a request as a line."""
    return json.dumps(msgspec.to_builtins(request), separators=(",", ":"))


def decode(line: str) -> Request:
    """Decode a line. Raises ValueError if it is no request."""
    if not (line.isascii() and line.isprintable()):
        raise ValueError("a request is plain text")
    request: Request = msgspec.json.decode(line, type=Request)
    return request
