"""The hand control that programs see: who it is, its model and version, and the requests that it does not know.

Where it is the mount itself, what the gateway carries out in the place of old motors it tells itself, and axes go
through it; other devices on the mount's bus answer for themselves.
"""

from __future__ import annotations

from functools import cache

from gateway.core.operations import Values
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.nexstar.surface.devices import MOTORS
from gateway.protocols.nexstar.versions import STARSENSE_VARIANT, numbered
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model, Version, show_version

#: What is presented when nobody says otherwise: the version most programs know best, on an alt-az fork, a fork on a
#: wedge or a German mount.
VERSION, FORK, WEDGE, GERMAN = "4.21", "6-8se", "cpc", "cge"
#: Answered whatever the version: one program asks it of every hand control and waits.
ALWAYS = "v"
#: Told by the gateway of the motors, which it moves, and by every other device itself.
_AXES = frozenset({"axis_position", "axis_done"})


def presented(model: str | None, version: str | None) -> Model:
    """The model's constants as a hand control of that version tells them."""
    name = model or FORK
    number = numbered(version or VERSION)
    return {
        **load("nexstar").models[name],
        "name": name,
        "version": number.shown,
        "counts_as": number.counts_as,
        "variant": number.variant,
    }


def fitting(equatorial: bool, german: bool | None, gps: bool, version: str | None) -> Model:
    """What is presented over a mount when nobody says otherwise; it has a GPS unit only if the mount has one."""
    model = presented((GERMAN if german else WEDGE) if equatorial else FORK, version)
    return {**model, "has": [part for part in model["has"] if part != "gps"] + ["gps"] * gps}


@cache
def _opcodes(version: Version) -> frozenset[int]:
    """The first bytes of the requests that a hand control which counts as that version knows."""
    known = [c for c in load("nexstar").commands.values() if c.name == ALWAYS or c.known_to(None, version)]
    return frozenset(command.request.prefix[0] for command in known)


def lacks(model: Model, frame: bytes) -> str:
    """Why the presented hand control passes over a request as a whole; empty where it knows it."""
    if frame[0] in _opcodes(model["counts_as"]):
        return ""
    name = "StarSense" if model["variant"] == STARSENSE_VARIANT else "hand control"
    return f"a {name} {show_version(model['version'])} has no such command"


def stands_against(session: NexStarSession, name: str, values: Values) -> bool:
    """Whether the mount's own answer would contradict what this gateway has told or does."""
    if name in _AXES:
        return values["device"] in MOTORS
    return name == "pulse_active" and MOTORS.get(values["device"]) in session.shared.pulse_ends


# --- what it says of itself -----------------------------------------------------------------------------------------


def version(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """V"""
    major, minor = session.model["version"]
    return {"major": major, "minor": minor}


def model(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """m"""
    return {"model": session.model["id"]}


def echo(session: NexStarSession, command: Command, values: Values) -> dict[str, int]:
    """K"""
    return values
