"""The hand control that clients see: its model and version, and the requests that it has.

If the mount's own hand control is presented, the gateway still answers for everything that it does itself, such as
positions and ends of gotos of the motors; other devices on the mount's bus answer for themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from gateway.core.operations import Values
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.nexstar.surface.devices import AXIS_BY_DEVICE
from gateway.protocols.nexstar.versions import STARSENSE_VARIANT, parse
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Model, Version, format_version

#: Presented by default: the version that most clients support best, and the models of an alt-az fork, a fork on a
#: wedge and a German mount.
DEFAULT_VERSION, FORK_MODEL, WEDGE_MODEL, GERMAN_MODEL = "4.21", "6-8se", "cpc", "cge"
#: Answered in every version: a client program sends it to every hand control and waits.
ANSWERED = "v"
#: The gateway answers these for the motors, which it moves; other devices answer them themselves.
_AXIS_COMMANDS = frozenset({"axis_position", "axis_done"})


def build_model(model: str | None, version: str | None) -> Model:
    """Return the row of a model with the constants that its hand control reports. None: a default model, version."""
    name, protocol = model or FORK_MODEL, load("nexstar")
    row = protocol.models[name]
    number = parse(version or (row["versions"][-1] if "dialect" in row else DEFAULT_VERSION))
    return {
        **row,
        "name": name,
        "lacking": protocol.lacking_commands(name),
        "version": number.reported,
        "counts_as": number.counts_as,
        "variant": number.variant,
    }


def default_model(equatorial: bool, german: bool | None, gps: bool, version: str | None) -> Model:
    """Return the default model to present for a mount; it has a GPS unit only if the mount does."""
    model = build_model((GERMAN_MODEL if german else WEDGE_MODEL) if equatorial else FORK_MODEL, version)
    return {**model, "has": [part for part in model["has"] if part != "gps"] + ["gps"] * gps}


def make_chooser(model: str | None, version: str | None) -> Callable[[bool, bool | None, bool], Model] | None:
    """Return the function that chooses the presented model when the mount is known; None if the user's model stays."""
    if model is None:
        return lambda equatorial, german, gps: default_model(equatorial, german, gps, version)
    in_altaz = load("nexstar").models[model].get("alt-az")
    return in_altaz and (lambda equatorial, german, gps: build_model(model if equatorial else in_altaz, version))


@cache
def _known_opcodes(model: str, version: Version) -> frozenset[int]:
    """Return the first bytes of the requests that are answered for this model and version."""
    known = [
        command
        for command in load("nexstar").commands.values()
        if command.exists_on(model, version) or (command.name == ANSWERED and model not in command.lacking_models)
    ]
    return frozenset(command.request.prefix[0] for command in known)


def missing_command_text(model: Model, frame: bytes) -> str:
    """Return why the presented hand control ignores a request; an empty string if it has the request."""
    if frame[0] in _known_opcodes(model["name"], model["counts_as"]):
        return ""
    name = "StarSense" if model["variant"] == STARSENSE_VARIANT else model.get("hand_control", "hand control")
    return f"a {name} {format_version(model['version'])} has no such command"


def contradicts_client(session: NexStarSession, command: str, values: Values) -> bool:
    """Whether the mount's own answer could contradict what the gateway does or has reported."""
    if command in _AXIS_COMMANDS:
        return values["device"] in AXIS_BY_DEVICE
    return command == "pulse_active" and AXIS_BY_DEVICE.get(values["device"]) in session.shared.pulse_ends


# --- version, model, echo -------------------------------------------------------------------------------------------


def version(session: NexStarSession) -> dict[str, int]:
    """V - the version, three numbers."""
    major, minor, patch = (*session.model["version"], 0)[:3]
    return {"major": major, "minor": minor, "patch": patch}


def model(session: NexStarSession) -> dict[str, int]:
    """m - the model's number."""
    return {"model": session.model["id"]}


def echo(values: Values) -> dict[str, int]:
    """K - the byte that was sent."""
    return values
