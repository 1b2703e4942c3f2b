"""Chooses the speed of a Meade that is nearest, in ratio, to a requested speed.

``nearest`` is for a speed on the sky or of an axis. ``instead_of_tracking`` is for the total speed of the right
ascension motor, for which drive rates, and guiding on top of them, are candidates too. The rates that the choice
changes (``:Sw :RA :RE :Rg``, the drive rate) are restored after the motion (``ends.py``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import SIDEREAL_ARCSECONDS

#: The sidereal rate in hertz, the unit of drive rates; and the range of displayed values that means sidereal.
SIDEREAL_HERTZ, SIDEREAL_SHOWN = 60.16427, (60.1, 60.2)
#: The four rates in degrees per second, from the manual: 1x and 16x sidereal, 2 and 8 degrees per second.
SPEEDS = {"RG": SIDEREAL_ARCSECONDS / 3600, "RC": 16 * SIDEREAL_ARCSECONDS / 3600, "RM": 2.0, "RS": 8.0}
#: Named drive rates as multiples of sidereal.
NAMED_DRIVES = {"sidereal": 1.0, "solar": 0.99727, "lunar": 0.97633}
#: Ratios that differ by less are equal: then the simpler choice is taken.
ALIKE = 1e-4
#: The slowest rate and the step of :RA and :RE, degrees per second; the step of :Rg, arcseconds per second.
_FREE_FROM, _FREE_STEP, _GUIDE_STEP = 0.1, 0.1, 0.1


class Speed(Struct, frozen=True):
    """A choice of rates. ``degrees`` is the resulting speed, degrees per second.

    command         the rate command of the direction key, None if no key is pressed
    guide           the guide rate to set for :RG, a fraction of sidereal
    fastest, free   the values for :Sw, and for :RA or :RE, degrees per second
    hertz           the drive rate to set, None to leave it
    west            the direction of the key on the first axis, if it differs from the requested direction
    """

    command: str | None
    degrees: float
    guide: float | None = None
    fastest: int | None = None
    free: float | None = None
    hertz: float | None = None
    west: bool | None = None


class ModelSpeeds(Struct, frozen=True):
    """The speeds of a model: whether it has :Rg, :RA with :RE, and :Sw; its usual and its settable fastest rates,
    degrees per second; its drive rates, hertz. ``keys`` are another maker's rate commands with their speeds, degrees
    per second, which are added to tracking.
    """

    guides: bool
    free: bool
    limits: bool
    fastest: int
    range: tuple[int, int]
    hertz: tuple[float, float]
    keys: tuple[tuple[str, float], ...] = ()


def ratio_error(requested: float, actual: float) -> float:
    """Return the difference of two speeds as the logarithm of their ratio; infinite for other signs or zero."""
    if requested == actual:
        return 0.0
    return abs(math.log(actual / requested)) if requested * actual > 0.0 else math.inf


def nearest(model_speeds: ModelSpeeds, degrees: float) -> Speed:
    """Return the choice for a direction key that is nearest to this speed, degrees per second."""
    return _best([*_arrows(model_speeds, degrees)], degrees)


def instead_of_tracking(model_speeds: ModelSpeeds, west: float, drive_rate: float) -> Speed:
    """Return the choice that turns the right ascension motor nearest to ``west`` degrees per second (signed).

    ``drive_rate`` is the current drive rate, degrees per second.
    """
    return _best(
        [
            *_drives(model_speeds, west, drive_rate),
            *(
                replace(speed, degrees=math.copysign(speed.degrees, west))
                for speed in (() if model_speeds.keys else _arrows(model_speeds, abs(west)))
                if speed.command != "RG"
            ),
        ],
        west,
    )


def _best(speeds: list[Speed], requested: float) -> Speed:
    """Return the first of the nearest speeds."""
    least = min(ratio_error(requested, speed.degrees) for speed in speeds)
    return next(speed for speed in speeds if ratio_error(requested, speed.degrees) <= least + ALIKE)


def _arrows(model_speeds: ModelSpeeds, degrees: float) -> Iterator[Speed]:
    """Yield the speeds of a direction key, the simpler ones first."""
    if model_speeds.keys:
        yield from (Speed(command, speed) for command, speed in model_speeds.keys)
        return
    if model_speeds.guides:
        arcseconds = min(
            math.floor(SIDEREAL_ARCSECONDS / _GUIDE_STEP) * _GUIDE_STEP, max(_GUIDE_STEP, degrees * 3600.0)
        )
        arcseconds = round(round(arcseconds / _GUIDE_STEP) * _GUIDE_STEP, 1)
        yield Speed("RG", arcseconds / 3600.0, guide=arcseconds / SIDEREAL_ARCSECONDS)
    else:
        yield Speed("RG", SPEEDS["RG"])
    yield Speed("RC", SPEEDS["RC"])
    if model_speeds.free:
        free = min(float(model_speeds.range[1]), max(_FREE_FROM, round(round(degrees / _FREE_STEP) * _FREE_STEP, 1)))
        yield Speed("RS", free, free=free)
        return
    yield Speed("RM", SPEEDS["RM"])
    yield Speed("RS", float(model_speeds.fastest))
    if model_speeds.limits:
        for fastest in range(model_speeds.range[0], model_speeds.range[1] + 1):
            yield Speed("RS", float(fastest), fastest=fastest)


def _drives(model_speeds: ModelSpeeds, west: float, drive: float) -> Iterator[Speed]:
    """Yield drive rates, with and without a direction key that adds to them."""
    yield Speed(None, drive)
    if model_speeds.keys:
        for sign in (1, -1):
            yield from (Speed(command, drive + sign * speed, west=sign > 0) for command, speed in model_speeds.keys)
        return
    if model_speeds.guides:
        more = west - drive
        arrow = next(_arrows(model_speeds, abs(more)))
        yield Speed("RG", drive + math.copysign(arrow.degrees, more), guide=arrow.guide, west=more > 0.0)
    else:
        for sign in (1, -1):
            yield Speed("RG", drive + sign * SPEEDS["RG"], west=sign > 0)
    hertz = _hertz(model_speeds, west)
    yield Speed(None, _speed(hertz), hertz=hertz)
    guide = SPEEDS["RG"]
    for sign in (1, -1):
        hertz = _hertz(model_speeds, west - sign * guide)
        yield Speed(
            "RG", _speed(hertz) + sign * guide, guide=1.0 if model_speeds.guides else None, hertz=hertz, west=sign > 0
        )


def _hertz(model_speeds: ModelSpeeds, degrees: float) -> float:
    low, high = model_speeds.hertz
    return min(high, max(low, round(degrees * 3600.0 * SIDEREAL_HERTZ / SIDEREAL_ARCSECONDS, 1)))


def _speed(hertz: float) -> float:
    """Return a drive rate in degrees per second; a telescope treats 60.1 to 60.2 hertz as sidereal."""
    if SIDEREAL_SHOWN[0] <= hertz <= SIDEREAL_SHOWN[1]:
        return SIDEREAL_ARCSECONDS / 3600.0
    return hertz / SIDEREAL_HERTZ * SIDEREAL_ARCSECONDS / 3600.0
