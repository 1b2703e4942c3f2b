"""The messages of a page over its WebSocket: requests that every client has, and requests that only pages have.

A message is a JSON object: ``do`` is the request, ``mount`` the number of the mount, ``id`` the number of the answer,
which the page chooses (0: no answer is wanted). The other fields are those of the request. A target is a ``name``, or
``ra`` and ``dec``, of date unless ``j2000`` is true. Angles are degrees, longitudes east positive, times Unix seconds.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

import msgspec
from msgspec import Meta, Struct

from gateway.core import requests

_Text = Annotated[str, Meta(max_length=200)]
Arrow = Literal["north", "south", "east", "west"]


class HeldArrow(Struct, frozen=True):
    """An arrow that a page holds down: the number of the mount, the direction, the number of the press."""

    mount: Annotated[int, Meta(ge=0, lt=1000)]
    direction: Arrow
    press: Annotated[int, Meta(ge=0)]


class Beat(Struct, frozen=True, tag="beat"):
    """The page is alive, and holds these arrows. All others are released; if beats are missing, all are."""

    held: Annotated[list[HeldArrow], Meta(max_length=1000)] = []


class Talk(Struct, frozen=True, tag="talk"):
    """Begin or end sending the conversation with clients and mount."""

    on: bool = True


class EnterPin(Struct, frozen=True, tag="pin"):
    """The pin that allows a view-only page to act."""

    pin: _Text = ""


class LookUp(Struct, frozen=True, tag="look_up"):
    """Return the data of an object or a position on the sky, and whether the mount may go to it."""

    where: requests.Target


class Search(Struct, frozen=True, tag="search"):
    """Return objects whose names begin with this text."""

    text: _Text = ""


class ShowNight(Struct, frozen=True, tag="night"):
    """Return the positions of Sun and Moon through the night."""


class Explain(Struct, frozen=True, tag="explain"):
    """Explain what happens with a command on this mount."""

    surface: _Text = ""
    command: _Text = ""


class Record(Struct, frozen=True, tag="record"):
    """Begin or end a recording."""

    on: bool = True


class Jog(Struct, frozen=True, tag="jog"):
    """Press a direction key: the mount moves until the key is released or the page disappears.

    ``press`` numbers the presses of a page from 1; with the number of a key that is held the rate is changed.
    """

    direction: Arrow
    rate: Annotated[int, Meta(ge=1, le=9)] = 5
    press: Annotated[int, Meta(ge=0)] = 0


class ReleaseArrow(Struct, frozen=True, tag="let_go"):
    """Release a direction key, or all of them; with ``press``, only if that press is still held."""

    direction: Arrow | None = None
    press: Annotated[int, Meta(ge=0)] = 0


#: What a view-only page may ask for, besides a stop.
Looks = Beat | Talk | EnterPin | LookUp | Search | ShowNight | Explain | ReleaseArrow | requests.ReadSlowRequest
#: What of the common requests a page may ask for.
Common = (
    requests.GotoRequest | requests.SyncRequest | requests.ParkRequest | requests.UnparkRequest
    | requests.HomeRequest | requests.TrackRequest | requests.GuideRequest | requests.SetClockRequest
    | requests.SetSiteRequest | requests.SetGuideRateRequest | requests.NarrowLimitsRequest | requests.StopOrHold
)  # fmt: skip
Wish = Looks | Record | Jog | Common
#: What a page calls otherwise than ``core/requests.py``.
_PAGE_NAMES = {"wake": "unpark", "ask": "look_up", "guide_rate": "guide rate"}


class _Numbered(Struct):
    id: int = 0


class _Head(_Numbered, kw_only=True):
    do: str
    #: -1: every mount.
    mount: Annotated[int, Meta(ge=-1, lt=1000)] = 0


class Message(NamedTuple):
    """A message: the number of its answer, the number of the mount, and the request."""

    id: int
    mount: int
    wish: Wish


def number(text: str | bytes) -> int:
    """Return the request number of a message that is otherwise unreadable; 0 if it has none."""
    try:
        return msgspec.json.decode(text, type=_Numbered).id
    except ValueError:
        return 0


def read(text: str | bytes, who: str) -> Message:
    """Decode a message of a page; ``who`` asks. Raises ValueError."""
    fields: dict[str, Any] = msgspec.json.decode(text, type=dict[str, Any])
    head = msgspec.convert(fields, _Head)
    fields |= {"type": _PAGE_NAMES.get(head.do, head.do), "number": requests.new_number(), "who": who}
    if head.do in ("goto", "sync", "look_up", "ask"):
        kind = "spot" if fields.get("name") is None else "named"
        fields["where"] = {**fields, "type": kind}
    return Message(head.id, head.mount, msgspec.convert(fields, Wish))
