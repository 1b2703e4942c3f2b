"""What the coordinates mean, and the side of the pier of a German mount."""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core.errors import Unsupported
from gateway.core.operations import GetAbilities, SiderealTime, TubeSide, Values
from gateway.protocols.alpaca.session import AlpacaSession
from gateway.protocols.alpaca.surface.given import place
from gateway.protocols.base.wants import Handling
from gateway.protocols.wireformat.command import Command

#: ASCOM's numbers for what coordinates mean, and for the sides of the pier.
TOPOCENTRIC, J2000 = 1, 2
EAST, WEST, UNKNOWN = 0, 1, -1


def equatorial_system(session: AlpacaSession, command: Command, values: Values) -> int:
    """By the setting of the surface."""
    return J2000 if session.model["equinox"] == "j2000" else TOPOCENTRIC


def side_of_pier(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """East is where a German mount looks west, its counterweight below: ASCOM's normal pointing state."""
    try:
        side = yield TubeSide()
    except Unsupported:
        return UNKNOWN
    return WEST if side == "W" else EAST


def destination_side(session: AlpacaSession, command: Command, values: Values) -> Handling:
    """With every goto such a mount chooses the side from which it looks over the pier."""
    ra, _ = place(values)
    if not (yield GetAbilities()).german:
        return UNKNOWN
    return EAST if wrap180((yield SiderealTime()) - ra) >= 0.0 else WEST
