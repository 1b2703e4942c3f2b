"""The session of an Alpaca program, the conditions of its requests, and the ranges of their parameters.

A program may change settings or move the mount only while it is connected; one that has never connected may read. Some
requests are refused while the mount is parked. Every request has a reply, even if it is refused.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.core.errors import Invalid, Refused, Unsupported
from gateway.core.operations import GetAbilities, GetActivity, GetStatus, SetTracking, Tracking, Values
from gateway.protocols.alpaca.tables import NotConnected, Parked, conditions_of, error_line, is_refusal
from gateway.protocols.base.session import ClientState, Session
from gateway.protocols.base.surface import Handler, Surface
from gateway.protocols.base.wants import Handling, decoded
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet
from gateway.protocols.wireformat.rows import SurfaceRow


class AlpacaClientState(ClientState):
    """What a program has set for itself: its target and site elevation, and whether it is connected."""

    connected: bool | None = None  # None until the program connects or disconnects
    ra: float | None = None  # of the target, degrees; None if it was not set
    dec: float | None = None  # of the target, degrees; None if it was not set
    elevation: float = 0.0  # of the site, metres
    track_failed: bool = False  # the program's last order to turn tracking on had no effect


class AlpacaSession(Session):
    """The session of a program, which is a ClientID on one computer."""

    inherits_settings = False  # another ClientID on the same computer is another program
    client_state_type = AlpacaClientState
    client: AlpacaClientState


class AlpacaSurface(Surface):
    """Answers every request: with a value, with null, or with the number and the text of a refusal."""

    def __init__(self, protocol: CommandSet, handlers: Mapping[str, Handler]) -> None:
        super().__init__(protocol, handlers, error_line)
        self.session_type, self.is_refusal = AlpacaSession, is_refusal

    def _carry_out(self, session: Session, command: Command, row: SurfaceRow, values: Values) -> Handling:
        yield from _check_conditions(session, command)
        reply = yield from super()._carry_out(session, command, row, values)
        if command.urgent and (yield GetActivity()).parked:
            raise Parked  # ASCOM's rule for a parked mount; the stop was sent all the same
        return reply


def _check_conditions(session: Session, command: Command) -> Handling:
    """Check the conditions of a member: a connected program, an unparked mount, tracking. Raises Fault if not met."""
    assert isinstance(session, AlpacaSession)
    needs, client = conditions_of(command.name), session.client
    if not (needs.always or client.connected or (client.connected is None and is_get(command))):
        raise NotConnected
    if needs.unparked and (yield GetActivity()).parked:
        raise Parked
    if needs.tracking is not None:
        if not needs.tracking and SetTracking.__name__ not in (yield GetAbilities()).can:
            raise Unsupported("This mount cannot stop tracking, which a goto over the horizon needs.")
        tracks = (yield GetStatus()).tracking is not Tracking.OFF
        if tracks is not needs.tracking and not (needs.tracking and client.track_failed):
            raise Refused(
                "The mount tracks: set Tracking to false first." if tracks
                else "The mount does not track: set Tracking to true first."
            )  # fmt: skip


def is_get(command: Command) -> bool:
    """Whether a request is a GET, which changes nothing."""
    return str(command.request.source).startswith("get ")


# --- parameters -----------------------------------------------------------------------------------------------------


def value_in_range(values: Values, field: str, name: str, low: float, high: float, unit: float = 1.0) -> Any:
    """Return the parameter ``field``. Raises Invalid if it is out of range; the message shows the values divided by
    ``unit``, so that it has the client's unit.
    """
    value = decoded(values)[field]
    if not low <= value <= high:
        raise Invalid(f"{name} is {value / unit:.10g}; it must be from {low / unit:.6g} to {high / unit:.6g}.")
    return value


def target_coordinates(values: Values) -> tuple[float, float]:
    """Return right ascension and declination, degrees. Raises Invalid."""
    ra = value_in_range(values, "ra", "RightAscension", 0.0, 360.0, unit=15.0)
    return ra % 360.0, value_in_range(values, "dec", "Declination", -90.0, 90.0)


def axis_number(values: Values) -> int:
    """Return 0 for the first axis, 1 for the second, 2 for a third, which no mount has. Raises Invalid."""
    number: int = value_in_range(values, "axis", "Axis", 0, 2)
    return number
