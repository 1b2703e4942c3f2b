"""What kind of mount it is: how it is built, what its coordinates mean, the side of its pier, and what it can do.

What it can do is told by the tables of the model and version that it has told.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, axis, place
from gateway.protocols.base.surface import Handler
from gateway.protocols.base.wants import Handling
from gateway.protocols.wireformat.command import Command

#: ASCOM's numbers for how a mount is built.
ALT_AZ, POLAR, GERMAN = 0, 1, 2
#: ASCOM's numbers for what coordinates mean, and for the sides of the pier.
TOPOCENTRIC, J2000 = 1, 2
EAST, WEST, UNKNOWN = 0, 1, -1


def alignment_mode(session: AlpacaSession, command: Command, values: Values) -> Handling:
    if (yield op.GetAbilities()).german:
        return GERMAN
    return POLAR if (yield op.GetStatus()).equatorial else ALT_AZ


def equatorial_system(session: AlpacaSession, command: Command, values: Values) -> int:
    """By the setting of the surface."""
    return J2000 if session.model["equinox"] == "j2000" else TOPOCENTRIC


def side_of_pier(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """East is where a German mount looks west, its counterweight below: ASCOM's normal pointing state."""
    try:
        side = yield op.TubeSide()
    except Unsupported:
        return UNKNOWN
    return WEST if side == "W" else EAST


def destination_side(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """With every goto such a mount chooses the side from which it looks over the pier."""
    ra, _ = place(values)
    if not (yield op.GetAbilities()).german:
        return UNKNOWN
    return EAST if wrap180((yield op.SiderealTime()) - ra) >= 0.0 else WEST


def axis_rates(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """Of a third axis none."""
    third = axis(values) == 2
    speeds = (yield op.GetAbilities()).speeds
    return {"value": [] if third else [{"Minimum": low, "Maximum": high} for low, high in speeds]}


def can_move_axis(session: AlpacaSession, command: Command, values: Values) -> Handling:
    third = axis(values) == 2
    return not third and op.MoveAxis.__name__ in (yield op.GetAbilities()).can


def _able(*operations: type[op.Operation]) -> Handler:
    """A member that says whether the mount can do all of these."""

    def able(session: AlpacaSession, command: Command, values: Values) -> Handling:
        can = (yield op.GetAbilities()).can
        return all(operation.__name__ in can for operation in operations)

    return able


can_find_home = _able(op.Home)
can_park = _able(op.Park)
#: What cannot be parked needs no unparking.
can_unpark = _able(op.Park, op.Unpark)
can_pulse_guide = _able(op.Pulse)
can_set_guide_rates = _able(op.SetGuideRate)
can_set_tracking = _able(op.SetTracking)
can_sync = _able(op.Sync)
