"""Compares what a server declares with how its mount behaves, because they can differ.

The declared equinox of coordinates is compared with the server's altitude and azimuth. If they contradict each other,
the log says so, and the declared equinox stays in use. The direction of a motion by hand is compared with the change of
the position. If the mount moves the wrong way, the gateway reverses that direction at once.
"""

from __future__ import annotations

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import hour_angle_to_horizon, separation, wrap180
from gateway.core import operations as op
from gateway.protocols.alpaca.driver.state import AlpacaDriver, read_member
from gateway.protocols.base.driver import Remark, Steps

#: Degrees. Equinoxes are compared at altitudes in this range, where refraction is small and the azimuth exact. The
#: right equinox fits altitude and azimuth to this tolerance; the other is worse by at least the margin.
ALTITUDE_RANGE, MATCH_ERROR, MATCH_MARGIN = (30.0, 80.0), 0.05, 0.08
#: Degrees by which refraction raises an object at an altitude of 30 degrees.
REFRACTION = 0.03
#: A direction is compared after so many degrees of motion, at this speed (degrees a second) or more, and not beyond
#: this declination (or altitude on an alt-az mount), degrees.
MIN_TRAVEL, MIN_SPEED, MAX_DECLINATION = 0.1, 0.05, 80.0
#: (axis, sense) -> direction.
DIRECTION_NAMES = {(1, 1): "west", (1, -1): "east", (2, 1): "north", (2, -1): "south"}


class CompareEquinox(op.Operation, frozen=True):
    """Internal: compare the declared equinox with altitude and azimuth, some seconds after a goto."""

    survives_abort = True


def compare_equinox(mount: AlpacaDriver, _: CompareEquinox | None = None) -> Steps:
    """Return the equinox that fits altitude and azimuth; None if ambiguous or unknown. Log if another is declared."""
    values = []
    for member in ("siderealtime", "rightascension", "declination", "altitude", "azimuth", "sitelatitude", "utcdate"):
        values.append((yield from read_member(mount, member)))
    if None in values or not ALTITUDE_RANGE[0] < values[3] < ALTITUDE_RANGE[1]:
        return None
    sidereal, ra, dec, altitude, azimuth, latitude, unix = values
    errors = {}
    for equinox, place in (("jnow", (ra, dec)), ("j2000", Sky().from_j2000(ra, dec, unix))):
        calculated = hour_angle_to_horizon(wrap180(sidereal - place[0]), place[1], latitude)
        errors[equinox] = separation(*calculated, azimuth, altitude)
    fits = min(errors, key=lambda equinox: errors[equinox])
    max_error = MATCH_ERROR + (REFRACTION if mount.refracts else 0.0)
    if errors[fits] > max_error or max(errors.values()) < errors[fits] + MATCH_MARGIN:
        return None
    mount.equinox_compared = True
    if mount.declares_equinox and fits != mount.equinox:
        yield Remark(
            f"the server declares {mount.equinox} coordinates, but its altitude and azimuth fit {fits} ones, "
            f"{max(errors.values()) * 60.0:.0f} arcminutes from these: if gotos miss by that, write equinox = "
            f'"{fits}" (--equinox {fits})'
        )
    return fits


def expect_direction(mount: AlpacaDriver, axis: int, sense: int, pier_side: str) -> None:
    """Store the sense on the sky that a fast hand motion should have, for ``check_sense``, unless verified before."""
    fast = abs(mount.hand_rates.get(axis, 0.0)) >= MIN_SPEED
    mount.sense_checks[axis] = (sense, pier_side, None)
    if mount.reversed is not None or not fast or (axis, pier_side) in mount.verified_senses:
        mount.sense_checks.pop(axis)


def check_sense(mount: AlpacaDriver, equatorial: op.Equatorial, horizontal: tuple[float, ...] | None) -> str:
    """Reverse each axis that moves against its expected direction; return a message about it, empty if none does."""
    position = (-equatorial.ra, equatorial.dec)
    if not mount.equatorial:
        if horizontal is None:
            return ""
        position = (horizontal[0], horizontal[1])
    text = ""
    for axis, (sense, side, start) in list(mount.sense_checks.items()):
        if abs(position[1]) > MAX_DECLINATION or axis not in mount.hand_rates:
            del mount.sense_checks[axis]
        elif start is None:
            mount.sense_checks[axis] = (sense, side, position)
        elif abs(travel := wrap180(position[axis - 1] - start[axis - 1]) * sense) > MIN_TRAVEL:
            del mount.sense_checks[axis]
            if side or axis == 1 or not mount.german:  # on an unknown side of the pier the next arrow may differ
                mount.verified_senses.add((axis, side))
            if travel < 0.0:
                mount.signs[axis, side] = -mount.signs.get((axis, side), 1)
                text = (
                    f"an arrow to the {DIRECTION_NAMES[axis, sense]} has moved the tube to the "
                    f"{DIRECTION_NAMES[axis, -sense]}: MoveAxis counts the other way there, so the gateway "
                    "now reverses arrows; reversed-axes (--reversed-axes) says so before the first arrow"
                )
    return text
