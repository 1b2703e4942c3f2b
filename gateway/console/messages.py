"""The messages that a page sends over its WebSocket: requests common to all clients, and requests of pages only.

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
    """Reports that the page is open, and the arrows it holds; others are released, or all if heartbeats stop."""

    held: Annotated[list[HeldArrow], Meta(max_length=1000)] = []


class Talk(Struct, frozen=True, tag="talk"):
    """Start or stop sending the page the messages between clients, gateway and mount."""

    on: bool = True


class EnterPin(Struct, frozen=True, tag="pin"):
    """Enter the PIN, which allows a view-only page to control the mount."""

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
    """Explain what the gateway does with a ``command`` of a client on ``surface`` (empty: the first) on this mount."""

    surface: _Text = ""
    command: _Text = ""


class Record(Struct, frozen=True, tag="record"):
    """Begin or end a recording."""

    on: bool = True


class PressArrow(Struct, frozen=True, tag="jog"):
    """Press an arrow: the mount moves until the arrow is released or the page disconnects.

    ``press`` numbers the presses of a page from 1 (0: none). With the number of a held press, only its rate changes.
    """

    direction: Arrow
    rate: Annotated[int, Meta(ge=1, le=9)] = 5  # key of the hand control, 1 (slowest) to 9
    press: Annotated[int, Meta(ge=0)] = 0


class ReleaseArrow(Struct, frozen=True, tag="let_go"):
    """Release an arrow, or all; with ``press``, only if that press is still held."""

    direction: Arrow | None = None
    press: Annotated[int, Meta(ge=0)] = 0


#: The requests that a view-only page may send, besides a stop.
ReadOnlyRequest = (
    Beat | Talk | EnterPin | LookUp | Search | ShowNight | Explain | ReleaseArrow | requests.ReadSlowRequest
)
#: The requests common to all clients that a page may send.
CommonRequest = (
    requests.GotoRequest | requests.SyncRequest | requests.ParkRequest | requests.UnparkRequest
    | requests.HomeRequest | requests.TrackRequest | requests.GuideRequest | requests.SetClockRequest
    | requests.SetSiteRequest | requests.SetGuideRateRequest | requests.NarrowLimitsRequest | requests.StopOrHold
)  # fmt: skip
#: Any request of a page.
PageRequest = ReadOnlyRequest | Record | PressArrow | CommonRequest
#: Name of a request on the page -> its name in ``core/requests.py`` or here, where they differ.
_PAGE_NAMES = {"wake": "unpark", "ask": "look_up", "guide_rate": "guide rate"}


class _AnswerNumber(Struct):
    id: int = 0


class _MessageHeader(_AnswerNumber, kw_only=True):
    do: str
    #: -1: every mount.
    mount: Annotated[int, Meta(ge=-1, lt=1000)] = 0


class Message(NamedTuple):
    """A decoded message: the number that its answer must carry, the number of the mount (-1: all), and the request."""

    answer_number: int
    mount_index: int
    request: PageRequest


def answer_number(text: str | bytes) -> int:
    """Return the number of the answer (``id``) to a message that cannot be decoded; 0 if it has none."""
    try:
        return msgspec.json.decode(text, type=_AnswerNumber).id
    except ValueError:
        return 0


def decode(text: str | bytes, client_name: str) -> Message:
    """Decode a message of the page named ``client_name``. Raises ValueError if it is not a valid request."""
    fields: dict[str, Any] = msgspec.json.decode(text, type=dict[str, Any])
    head = msgspec.convert(fields, _MessageHeader)
    fields |= {"type": _PAGE_NAMES.get(head.do, head.do), "number": requests.new_request_number(), "who": client_name}
    if head.do in ("goto", "sync", "look_up", "ask"):
        kind = "spot" if fields.get("name") is None else "named"
        fields["where"] = {**fields, "type": kind}
    return Message(head.id, head.mount, msgspec.convert(fields, PageRequest))
