"""Requests to a gateway from a page, a broker, a shell or Python, in one vocabulary.

Every source (the page's socket, MQTT, the control endpoint) decodes its messages once, and inside the gateway a request
is one of these values. Recordings and the control endpoint hold it as one line of plain ASCII JSON. Angles are in
degrees, north and east positive. Every request has a random number, by which it can be followed or cancelled.
"""

from __future__ import annotations

import json
import os
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
from msgspec import Meta, Struct

from gateway.core.operations import Direction


class Spot(Struct, frozen=True, tag="spot"):
    """A position on the sky in degrees, of the equinox of date or of J2000."""

    ra: float
    dec: float
    j2000: bool = False  # else of date


class Body(Struct, frozen=True, tag="body"):
    """A planet by its English name, or the Moon: the gateway computes its position."""

    name: str


class Named(Struct, frozen=True, tag="named"):
    """An object by the name that the user typed; it is looked up before the request is carried out."""

    name: Annotated[str, Meta(max_length=200)]


ResolvedTarget = Spot | Body  # a target that needs no look-up
Target = ResolvedTarget | Named


def new_request_number() -> str:
    """Return a unique random number for a request, as text."""
    return os.urandom(8).hex()


class ChangeRequest(Struct, frozen=True, kw_only=True):
    """Base of the requests that change something. ``who`` is the client that makes it; empty for the command line."""

    number: str = msgspec.field(default_factory=new_request_number)
    who: str = ""  # the client


class GotoRequest(ChangeRequest, frozen=True, tag="goto"):
    """Slew to a target and track it."""

    where: Target


class SyncRequest(ChangeRequest, frozen=True, tag="sync"):
    """Tell the mount that it points at this target now."""

    where: Target


class ParkRequest(ChangeRequest, frozen=True, tag="park"):
    """Go to the park position."""


class HomeRequest(ChangeRequest, frozen=True, tag="home"):
    """Go to the home position."""


class UnparkRequest(ChangeRequest, frozen=True, tag="unpark"):
    """Unpark the mount, or wake it, so that it tracks."""


class MoveRequest(ChangeRequest, frozen=True, tag="move"):
    """Move by hand for some seconds, at the rate of a ``key`` of the hand control."""

    direction: Direction
    key: int  # of the hand control, 1 (slowest) to 9
    seconds: float


class PressKeyRequest(ChangeRequest, frozen=True, tag="press"):
    """Move by hand until ``ReleaseKeyRequest``. Repeating the request keeps the motion alive (dead man's switch)."""

    direction: Direction
    key: int  # of the hand control, 1 (slowest) to 9


class ReleaseKeyRequest(ChangeRequest, frozen=True, tag="let go"):
    """End the motion that ``PressKeyRequest`` began under this number. A motion not yet begun becomes a short tap; with
    ``lost`` (the user did not release the key) it is dropped.
    """

    lost: bool = False  # a motion not yet begun is dropped


class TrackRequest(ChangeRequest, frozen=True, tag="track"):
    """Turn tracking on or off; optionally set the rate: ``sidereal``, ``lunar`` or ``solar``."""

    on: bool = True
    rate: Literal["sidereal", "lunar", "solar"] | None = None


class SetClockRequest(ChangeRequest, frozen=True, tag="time"):
    """Set the mount's clock: UTC as Unix seconds, and local time minus UTC in hours."""

    unix: Annotated[float, Meta(ge=0.0, le=4e9)]
    offset: Annotated[float, Meta(ge=-14.0, le=14.0)]


class SetSiteRequest(ChangeRequest, frozen=True, tag="site"):
    """Set the mount's site."""

    latitude: Annotated[float, Meta(ge=-90.0, le=90.0)]
    longitude: Annotated[float, Meta(ge=-180.0, le=360.0)]


class GuideRequest(ChangeRequest, frozen=True, tag="guide"):
    """Guide in a direction on the sky for some milliseconds."""

    direction: Direction
    ms: Annotated[int, Meta(ge=1, le=5000)]


class SetGuideRateRequest(ChangeRequest, frozen=True, tag="guide rate"):
    """Set the guide rate of both axes, as a fraction of sidereal."""

    rate: Annotated[float, Meta(gt=0.0, le=1.0)]


class NarrowLimitsRequest(ChangeRequest, frozen=True, tag="narrow"):
    """Narrow the limits of altitude, distance from the Sun and hour angle past the meridian, degrees, until the gateway
    ends. A field that is None keeps the limit of the configuration.
    """

    lowest: Annotated[float, Meta(ge=-90.0, le=90.0)] | None = None
    highest: Annotated[float, Meta(ge=-90.0, le=90.0)] | None = None
    sun: Annotated[float, Meta(ge=0.0, le=90.0)] | None = None  # distance from the Sun
    hour_angle: Annotated[float, Meta(gt=0.0, le=180.0)] | None = None  # past the meridian


class OperationRequest(ChangeRequest, frozen=True, tag="perform"):
    """Carry out an operation of ``core/operations``, by its name and fields; the text of the answer is JSON."""

    operation: str  # name of its class
    fields: dict[str, Any] = {}


class ReadSlowRequest(Struct, frozen=True, tag="look"):
    """Read from the mount the values that the gateway does not poll: the pier side and the drive rate."""


class ProgressRequest(Struct, frozen=True, tag="follow"):
    """Ask for the progress of the request with this number."""

    number: str  # of the request to follow


class CancelRequest(Struct, frozen=True, tag="end"):
    """Cancel the request with this number: end the motion that it began, and no other."""

    number: str  # of the request to cancel


class StateRequest(Struct, frozen=True, tag="see"):
    """Ask for the ``State`` of the mount. Without ``fresh`` it is made from cached readings only."""

    fresh: bool = True  # ask the mount


class StopRequest(Struct, frozen=True, tag="stop"):
    """End every motion; done when the positions show the mount at rest. ``who``: empty for the command line or MQTT."""

    who: str = ""  # the client


class HoldRequest(Struct, frozen=True, tag="hold"):
    """Stop, and refuse every motion until ``ReleaseHoldRequest``, also after a restart of the gateway."""

    who: str = ""  # the client


class ReleaseHoldRequest(Struct, frozen=True, tag="release"):
    """Let clients move the mount again after ``HoldRequest``."""

    who: str = ""  # the client


StopOrHold = StopRequest | HoldRequest | ReleaseHoldRequest
Request = (
    GotoRequest | SyncRequest | ParkRequest | HomeRequest | UnparkRequest | MoveRequest | PressKeyRequest
    | ReleaseKeyRequest | GuideRequest | TrackRequest | SetClockRequest | SetSiteRequest | SetGuideRateRequest
    | NarrowLimitsRequest | OperationRequest | ReadSlowRequest | ProgressRequest | CancelRequest | StateRequest
    | StopOrHold
)  # fmt: skip

#: The outcome of a request: carried out, still in progress, not carried out.
DONE, UNDER_WAY, FAILED = "done", "under way", "failed"


class Answer(NamedTuple):
    """The outcome of a request, and its text for the person who made it; for ``StateRequest`` a ``State`` as JSON.

    ``fault`` is the class of the error, if the request failed with an error of ``core/errors.py``.
    """

    outcome: str  # DONE, UNDER_WAY or FAILED
    text: str
    fault: str = ""  # class of the error

    @property
    def is_ok(self) -> bool:
        return self.outcome == DONE

    def __str__(self) -> str:
        return f"{self.outcome} {self.text}"


def encode(request: Request) -> str:
    """Encode a request as one line of JSON."""
    return json.dumps(msgspec.to_builtins(request), separators=(",", ":"))


def decode(line: str) -> Request:
    """Decode a line that `encode` has made. Raises ValueError if it is no request."""
    if not (line.isascii() and line.isprintable()):
        raise ValueError("a request is plain text")
    request: Request = msgspec.json.decode(line, type=Request)
    return request
