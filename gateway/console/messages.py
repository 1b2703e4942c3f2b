"""The requests of a page over its WebSocket: one struct for each, distinguished by ``do``.

The page chooses ``id``, and the answer has the same one. Angles are degrees, longitudes east positive, times Unix
seconds.
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
    """Base class: the number of the mount, and the number of the answer (0: no answer is wanted)."""

    id: int = 0
    mount: Annotated[int, Meta(ge=-1, lt=1000)] = 0


class HeldArrow(Struct, frozen=True):
    """An arrow that a page holds down: the number of the mount, the direction, the number of the press."""

    mount: Annotated[int, Meta(ge=0, lt=1000)]
    direction: Arrow
    press: Annotated[int, Meta(ge=0)]


class Beat(Request, frozen=True, tag="beat"):
    """The page is alive, and holds these arrows. What it does not name is released; without these messages all is."""

    held: Annotated[list[HeldArrow], Meta(max_length=1000)] = []


class Talk(Request, frozen=True, tag="talk"):
    """Begin or end sending the conversation with clients and mount."""

    on: bool = True


class Pin(Request, frozen=True, tag="pin"):
    """The pin that allows a view-only page to act."""

    pin: _Text = ""


class LookUp(Request, frozen=True, tag="look_up"):
    """Return what is known of an object, and whether the mount may go there."""

    name: _Text = ""


class Ask(Request, frozen=True, tag="ask"):
    """Like ``LookUp``, but for a position on the sky."""

    ra: _Angle = 0.0
    dec: _Height = 0.0
    j2000: bool = True


class Search(Request, frozen=True, tag="search"):
    """Return objects whose names begin with this text."""

    text: _Text = ""


class Explain(Request, frozen=True, tag="explain"):
    """Explain what happens with one command on this mount."""

    surface: _Text = ""
    command: _Text = ""


class Act(Request, frozen=True):
    """Base class of requests that change something; view-only pages may send none of them but a stop."""


class Stop(Act, frozen=True, tag="stop"):
    """End every motion; on all mounts if ``mount`` is -1."""


class Hold(Act, frozen=True, tag="hold"):
    """Stop, and let nothing move the mount until it is released."""


class Release(Act, frozen=True, tag="release"):
    """End the hold."""


class Jog(Act, frozen=True, tag="jog", kw_only=True):
    """Press a direction key: the mount moves until the key is released or the page disappears.

    ``press`` numbers the presses of a page from 1; with the number of a key that is held the rate is changed.
    """

    direction: Arrow
    rate: Annotated[int, Meta(ge=1, le=9)] = 5
    press: Annotated[int, Meta(ge=0)] = 0


class LetGo(Act, frozen=True, tag="let_go"):
    """Release one direction key, or all of them; with ``press``, only if that press is the one that is held."""

    direction: Arrow | None = None
    press: Annotated[int, Meta(ge=0)] = 0


class Aimed(Act, frozen=True):
    """Base class of requests with a target: a name, or right ascension and declination."""

    name: _Text | None = None
    ra: _Angle | None = None
    dec: _Height | None = None
    j2000: bool = True


class Goto(Aimed, frozen=True, tag="goto"):
    """Slew to the target and track it."""


class Sync(Aimed, frozen=True, tag="sync"):
    """The mount points at the target now."""


class Park(Act, frozen=True, tag="park"):
    """Slew to the park position and turn tracking off."""


class Unpark(Act, frozen=True, tag="unpark"):
    """End the parked state."""


class Home(Act, frozen=True, tag="home"):
    """Slew to the home position."""


class Wake(Act, frozen=True, tag="wake"):
    """Wake a mount that hibernates."""


class Track(Act, frozen=True, tag="track"):
    """Turn tracking on or off, or change its rate."""

    on: bool = True
    rate: Literal["sidereal", "lunar", "solar"] | None = None


class Time(Act, frozen=True, tag="time", kw_only=True):
    """Set the clock to the browser's: UTC, and local time minus UTC in hours."""

    unix: Annotated[float, Meta(ge=0.0, le=4e9)]
    offset: Annotated[float, Meta(ge=-14.0, le=14.0)] = 0.0


class Site(Act, frozen=True, tag="site", kw_only=True):
    """Set the site of the mount."""

    latitude: _Height
    longitude: Annotated[float, Meta(ge=-180.0, le=360.0)]


class Record(Act, frozen=True, tag="record"):
    """Begin or end a recording."""

    on: bool = True


#: Requests that become an order to the mount unchanged.
Command = Goto | Sync | Park | Unpark | Home | Wake | Track | Time | Site
#: Requests that are carried out and answered.
Asked = Talk | Pin | LookUp | Ask | Search | Explain | Stop | Hold | Release | Jog | LetGo | Record | Command
Any = Beat | Asked
_DECODER = msgspec.json.Decoder(Any)


def read(text: str | bytes) -> Any:
    """Decode a request of a page. Raises ValueError."""
    request: Any = _DECODER.decode(text)
    return request
