"""What a page may ask for over its WebSocket: one struct a request, told apart by ``do``.

``id`` is drawn by the page, and the answer bears it. Angles are degrees, longitudes east positive, times Unix seconds.
"""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

_Angle = Annotated[float, Meta(ge=0.0, le=360.0)]
_Height = Annotated[float, Meta(ge=-90.0, le=90.0)]
_Text = Annotated[str, Meta(max_length=200)]
Arrow = Literal["north", "south", "east", "west"]


class Request(Struct, frozen=True, tag_field="do"):
    """Base: which mount is meant, and the number of the answer (0: none is wanted)."""

    id: int = 0
    mount: Annotated[int, Meta(ge=-1, lt=1000)] = 0


class Beat(Request, frozen=True, tag="beat"):
    """The page lives. What it moves by hand ends when this stays away."""


class Talk(Request, frozen=True, tag="talk"):
    """Show the conversation on both sides, or no longer."""

    on: bool = True


class Pin(Request, frozen=True, tag="pin"):
    """What lets a page act that so far only looks."""

    pin: _Text = ""


class LookUp(Request, frozen=True, tag="look_up"):
    """What is known of an object, and whether the mount may go there."""

    name: _Text = ""


class Ask(Request, frozen=True, tag="ask"):
    """The same of a place on the sky."""

    ra: _Angle = 0.0
    dec: _Height = 0.0
    j2000: bool = True


class Search(Request, frozen=True, tag="search"):
    """Objects whose name begins so."""

    text: _Text = ""


class Explain(Request, frozen=True, tag="explain"):
    """What becomes of one command, on this mount."""

    surface: _Text = ""
    command: _Text = ""


class Act(Request, frozen=True):
    """Base of what changes something: a page that only looks is refused, except for a stop."""


class Stop(Act, frozen=True, tag="stop"):
    """End every motion; of every mount where ``mount`` is -1."""


class Hold(Act, frozen=True, tag="hold"):
    """Stop, and let nothing move it before it is released."""


class Release(Act, frozen=True, tag="release"):
    """End the hold."""


class Jog(Act, frozen=True, tag="jog", kw_only=True):
    """Press an arrow: the mount moves until it is let go, or until the page is gone."""

    direction: Arrow
    rate: Annotated[int, Meta(ge=1, le=9)] = 5


class LetGo(Act, frozen=True, tag="let_go"):
    """Let go of one arrow, or of all of them."""

    direction: Arrow | None = None


class Aimed(Act, frozen=True):
    """Base of what needs a place: a name, or right ascension and declination."""

    name: _Text | None = None
    ra: _Angle | None = None
    dec: _Height | None = None
    j2000: bool = True


class Goto(Aimed, frozen=True, tag="goto"):
    """Point there and track."""


class Sync(Aimed, frozen=True, tag="sync"):
    """It points there now."""


class Park(Act, frozen=True, tag="park"):
    """Go to the park position."""


class Unpark(Act, frozen=True, tag="unpark"):
    """Take up service again."""


class Home(Act, frozen=True, tag="home"):
    """Go to the home position."""


class Wake(Act, frozen=True, tag="wake"):
    """Wake a mount that hibernates."""


class Track(Act, frozen=True, tag="track"):
    """Tracking on or off, or at another rate."""

    on: bool = True
    rate: Literal["sidereal", "lunar", "solar"] | None = None


class Time(Act, frozen=True, tag="time", kw_only=True):
    """The page's own clock: UTC, and local time minus UTC in hours."""

    unix: Annotated[float, Meta(ge=0.0, le=4e9)]
    offset: Annotated[float, Meta(ge=-14.0, le=14.0)] = 0.0


class Site(Act, frozen=True, tag="site", kw_only=True):
    """Where the mount stands."""

    latitude: _Height
    longitude: Annotated[float, Meta(ge=-180.0, le=360.0)]


class Record(Act, frozen=True, tag="record"):
    """Begin a recording, or end it."""

    on: bool = True


#: What becomes an order to the mount as it is.
Command = Goto | Sync | Park | Unpark | Home | Wake | Track | Time | Site
#: What is carried out, and answered.
Asked = Talk | Pin | LookUp | Ask | Search | Explain | Stop | Hold | Release | Jog | LetGo | Record | Command
Any = Beat | Asked
_DECODER = msgspec.json.Decoder(Any)


def read(text: str | bytes) -> Any:
    """What a page has sent. Raises ValueError."""
    request: Any = _DECODER.decode(text)
    return request
