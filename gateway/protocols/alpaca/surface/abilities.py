"""Members that describe the mount: its type, the equinox of coordinates, the side of the pier, and its abilities.

The abilities are those of the real mount, by its model and version in the mapping tables.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.core.operations import Values
from gateway.protocols.alpaca.surface.client import AlpacaSession, axis_number, target_coordinates
from gateway.protocols.base.surface import Handler
from gateway.protocols.base.wants import Handling
from gateway.protocols.wireformat.command import Command

#: ASCOM's numbers for types of mounts.
ALT_AZ, POLAR, GERMAN = 0, 1, 2
#: ASCOM's numbers for coordinate systems, and for the sides of the pier.
TOPOCENTRIC, J2000 = 1, 2
EAST, WEST, UNKNOWN = 0, 1, -1


def alignment_mode() -> Handling:
    if (yield op.GetAbilities()).german:
        return GERMAN
    return POLAR if (yield op.GetStatus()).equatorial else ALT_AZ


def equatorial_system(session: AlpacaSession) -> int:
    """Return ASCOM's number of the equinox that is configured for the surface."""
    return J2000 if session.model["equinox"] == "j2000" else TOPOCENTRIC


def side_of_pier() -> Handling:
    """Return the pier side, -1: unknown. East is the normal pointing state: the tube east of the pier points west."""
    try:
        side = yield op.TubeSide()
    except Unsupported:
        return UNKNOWN
    return WEST if side == "W" else EAST


def destination_side(values: Values) -> Handling:
    """Return the pier side after a goto: east for a position west of the meridian, else west; -1 unless German."""
    ra, _ = target_coordinates(values)
    if not (yield op.GetAbilities()).german:
        return UNKNOWN
    return EAST if wrap180((yield op.SiderealTime()) - ra) >= 0.0 else WEST


def axis_rates(values: Values) -> Handling:
    """Return the speed ranges of an axis, degrees per second; a third axis has none."""
    third = axis_number(values) == 2
    speeds = (yield op.GetAbilities()).speeds
    return {"value": [] if third else [{"Minimum": low, "Maximum": high} for low, high in speeds]}


def can_move_axis(values: Values) -> Handling:
    third = axis_number(values) == 2
    return not third and op.MoveAxis.__name__ in (yield op.GetAbilities()).can


def _ability_handler(*operations: type[op.Operation]) -> Handler:
    """Return the handler of a member that reports whether the mount can carry out all of these operations."""

    def able(session: AlpacaSession, command: Command, values: Values) -> Handling:
        can = (yield op.GetAbilities()).can
        return all(operation.__name__ in can for operation in operations)

    return able


can_find_home = _ability_handler(op.Home)
can_park = _ability_handler(op.Park)
#: A mount that cannot park cannot unpark either.
can_unpark = _ability_handler(op.Park, op.Unpark)
can_pulse_guide = _ability_handler(op.Pulse)
can_set_guide_rates = _ability_handler(op.SetGuideRate)
can_set_tracking = _ability_handler(op.SetTracking)
can_sync = _ability_handler(op.Sync)
