"""What the mount can do, by the tables of the model and version that it has told."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.operations import Values
from gateway.protocols.alpaca.session import AlpacaSession
from gateway.protocols.alpaca.surface.given import axis
from gateway.protocols.base.wants import Handling
from gateway.protocols.wireformat.command import Command

#: ASCOM's numbers for how a mount is built.
ALT_AZ, POLAR, GERMAN = 0, 1, 2


def alignment_mode(session: AlpacaSession, command: Command, values: Values) -> Handling:
    if (yield op.GetAbilities()).german:
        return GERMAN
    return POLAR if (yield op.GetStatus()).equatorial else ALT_AZ


def axis_rates(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Of a third axis none."""
    third = axis(values) == 2
    speeds = (yield op.GetAbilities()).speeds
    return {"value": [] if third else [{"Minimum": low, "Maximum": high} for low, high in speeds]}


def can_move_axis(session: AlpacaSession, command: Command, values: Values) -> Handling:
    third = axis(values) == 2
    return not third and (yield from _can(op.MoveAxis))


def can_find_home(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.Home))


def can_park(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.Park))


def can_unpark(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """What cannot be parked needs no unparking."""
    return (yield from _can(op.Park)) and (yield from _can(op.Unpark))


def can_pulse_guide(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.Pulse))


def can_set_guide_rates(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.SetGuideRate))


def can_set_tracking(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.SetTracking))


def can_sync(session: AlpacaSession, command: Command, values: Values) -> Handling:
    return (yield from _can(op.Sync))


def _can(operation: type[op.Operation]) -> Handling:
    return operation.__name__ in (yield op.GetAbilities()).can
