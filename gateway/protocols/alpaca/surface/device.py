"""The members of every ASCOM device: connecting, names, the list of its state, and members that the gateway lacks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.core import operations as op
from gateway.core.about import version
from gateway.core.errors import Fault, Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface import abilities, motion
from gateway.protocols.alpaca.surface.client import AlpacaSession
from gateway.protocols.base.wants import CheckPossible, Handling, decoded
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.numerals import moment

#: The name of the action that returns why the last goto ended before its goal; an empty text if it did not.
ENDED_SHORT_ACTION = "GotoEndedShort"


def action(values: Values) -> Handling:
    """Return why the last goto ended before its goal, the only action. Raises Unsupported for any other action."""
    if decoded(values)["action"].casefold() != ENDED_SHORT_ACTION.casefold():
        raise Unsupported(f"The only action is {ENDED_SHORT_ACTION}.")
    return {"value": (yield op.GetActivity()).short}


def supported_actions() -> dict[str, Any]:
    return {"value": [ENDED_SHORT_ACTION]}


def refuse_member(command: Command) -> None:
    """Raise Unsupported: the gateway does not have this member."""
    raise Unsupported(f"Not available: {command.help}.")


def connect(session: AlpacaSession) -> Handling:
    """Mark the program as connected. Raises NoAnswer if the mount does not answer at present."""
    yield CheckPossible(op.Position())
    session.client.connected = True


def connected(session: AlpacaSession) -> bool:
    return session.client.connected is True


def set_connected(session: AlpacaSession, values: Values) -> Handling:
    """Mark the program as connected or disconnected."""
    if decoded(values)["on"]:
        yield from connect(session)
    else:
        session.client.connected = False


def disconnect(session: AlpacaSession) -> None:
    session.client.connected = False


def name() -> Handling:
    """Return the mount's product name, or a general name until the mount has answered."""
    try:
        return (yield op.GetIdentity()).product
    except Fault:
        return "Telescope mount"


def description() -> Handling:
    """Return the mount's product name, model and version."""
    try:
        identity: op.Identity = yield op.GetIdentity()
    except Fault:
        return "A mount that has not answered yet, by mount-gateway"
    version_text = f" {identity.version}" if identity.version not in ("", "?") else ""
    return f"{identity.product}, {identity.model}{version_text}, by mount-gateway"


def driver_version() -> dict[str, str]:
    return {"value": version()}


def device_state(session: AlpacaSession) -> Handling:
    """Return the values that programs poll, in one reply; values that the mount does not report now are left out."""
    state: list[dict[str, Any]] = []
    for label, reading in _polled_values(session):
        try:
            state.append({"Name": label, "Value": (yield from reading)})
        except Fault:
            continue
    return {"value": [*state, {"Name": "TimeStamp", "Value": moment(session.clock()).decode()}]}


def _polled_values(session: AlpacaSession) -> Iterator[tuple[str, Handling]]:
    yield "Altitude", _read_field(op.HorizontalPosition(), "alt")
    yield "AtHome", motion.at_home()
    yield "AtPark", motion.at_park()
    yield "Azimuth", _read_field(op.HorizontalPosition(), "az")
    yield "Declination", _read_field(op.Position(), "dec")
    yield "IsPulseGuiding", motion.is_pulse_guiding()
    yield "RightAscension", _in_hours(_read_field(op.Position(), "ra"))
    yield "SideOfPier", abilities.side_of_pier()
    yield "SiderealTime", _in_hours(_read_field(op.SiderealTime()))
    yield "Slewing", motion.slewing()
    yield "Tracking", motion.tracking()
    yield "UTCDate", _read_mount_utc()


def _read_field(operation: op.Operation, field: str = "") -> Handling:
    value = yield operation
    return getattr(value, field) if field else value


def _in_hours(degrees: Handling) -> Handling:
    return ((yield from degrees) / 15.0) % 24.0


def _read_mount_utc() -> Handling:
    return moment((yield op.GetClock()).unix).decode()
