"""Chooses the speed of a Meade that is nearest, in ratio, to a requested speed.

``nearest`` is for a speed on the sky or of an axis. ``nearest_total_speed`` is for the total speed of the right
ascension motor, for which drive rates, and guiding on top of them, are candidates too. The rates that the choice
changes (``:Sw :RA :RE :Rg``, the drive rate) are restored after the motion (``ends.py``, ``drive.py``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S

#: The sidereal rate in hertz, the unit of drive rates; and the range of displayed values that means sidereal.
SIDEREAL_HERTZ, SIDEREAL_HERTZ_RANGE = 60.16427, (60.1, 60.2)
#: The four rates in degrees per second, from the manual: 1x and 16x sidereal, 2 and 8 degrees per second.
SPEEDS = {"RG": SIDEREAL_ARCSEC_PER_S / 3600, "RC": 16 * SIDEREAL_ARCSEC_PER_S / 3600, "RM": 2.0, "RS": 8.0}
#: Named drive rates as multiples of sidereal.
DRIVE_RATES = {"sidereal": 1.0, "solar": 0.99727, "lunar": 0.97633}
#: Ratios that differ by less are equal: then the simpler choice is taken.
RATIO_TOLERANCE = 1e-4
#: The slowest rate and the step of :RA and :RE, degrees per second; the step of :Rg, arcseconds per second.
_MIN_AXIS_RATE, _AXIS_STEP, _GUIDE_STEP = 0.1, 0.1, 0.1


class Speed(Struct, frozen=True):
    """A choice of rates. ``deg_per_s`` is the resulting speed, degrees per second.

    command         the rate command of the direction key, None if no key is pressed
    guide           the guide rate to set for :RG, a fraction of sidereal; None to leave it
    max_speed       the value for :Sw, and axis_rate that for :RA or :RE, degrees per second; None to leave it
    hertz           the drive rate to set, hertz; None to leave it
    west            whether the west key is pressed (False: the east key); None: that of the requested direction
    """

    command: str | None
    deg_per_s: float
    guide: float | None = None
    max_speed: int | None = None
    axis_rate: float | None = None
    hertz: float | None = None
    west: bool | None = None


class ModelSpeeds(Struct, frozen=True):
    """The speeds of a model, degrees per second. ``guides``: it has :Rg (guide rate). ``has_any_rate``: it has :RA, :RE
    (any rate of an axis). ``max_speed``: that of :RS at power-on. ``has_max_speed``: it has :Sw, which sets that speed
    within ``max_speed_range``. ``hertz_range``: drive rates, hertz. ``speeds``: another maker's commands and speeds.
    """

    guides: bool
    has_any_rate: bool
    has_max_speed: bool
    max_speed: int
    max_speed_range: tuple[int, int]
    hertz_range: tuple[float, float]
    speeds: tuple[tuple[str, float], ...] = ()


def ratio_error(requested: float, actual: float) -> float:
    """Return the absolute logarithm of the ratio of two speeds; infinite if their signs differ or only one is 0."""
    if requested == actual:
        return 0.0
    return abs(math.log(actual / requested)) if requested * actual > 0.0 else math.inf


def nearest(model_speeds: ModelSpeeds, requested: float) -> Speed:
    """Return the choice for a direction key that is nearest to this speed, degrees per second."""
    return _nearest_choice([*_key_speeds(model_speeds, requested)], requested)


def nearest_total_speed(model_speeds: ModelSpeeds, west_speed: float, drive_rate: float) -> Speed:
    """Return the choice that turns the right ascension motor nearest to ``west_speed`` (signed, degrees per second).
    ``drive_rate`` is the current drive rate, degrees per second.
    """
    return _nearest_choice(
        [
            *_drive_speeds(model_speeds, west_speed, drive_rate),
            *(
                replace(speed, deg_per_s=math.copysign(speed.deg_per_s, west_speed))
                for speed in (() if model_speeds.speeds else _key_speeds(model_speeds, abs(west_speed)))
                if speed.command != "RG"
            ),
        ],
        west_speed,
    )


def _nearest_choice(speeds: list[Speed], requested: float) -> Speed:
    """Return the speed nearest to ``requested`` by ratio, degrees per second; of equally near speeds the first."""
    least = min(ratio_error(requested, speed.deg_per_s) for speed in speeds)
    return next(speed for speed in speeds if ratio_error(requested, speed.deg_per_s) <= least + RATIO_TOLERANCE)


def _key_speeds(model_speeds: ModelSpeeds, requested: float) -> Iterator[Speed]:
    """Yield the speeds a direction key can have, adjustable ones set near ``requested``; the simpler choices first."""
    if model_speeds.speeds:
        yield from (Speed(command, speed) for command, speed in model_speeds.speeds)
        return
    if model_speeds.guides:
        arcseconds = min(
            math.floor(SIDEREAL_ARCSEC_PER_S / _GUIDE_STEP) * _GUIDE_STEP, max(_GUIDE_STEP, requested * 3600.0)
        )
        arcseconds = round(round(arcseconds / _GUIDE_STEP) * _GUIDE_STEP, 1)
        yield Speed("RG", arcseconds / 3600.0, guide=arcseconds / SIDEREAL_ARCSEC_PER_S)
    else:
        yield Speed("RG", SPEEDS["RG"])
    yield Speed("RC", SPEEDS["RC"])
    if model_speeds.has_any_rate:
        free = max(_MIN_AXIS_RATE, round(round(requested / _AXIS_STEP) * _AXIS_STEP, 1))
        free = min(float(model_speeds.max_speed_range[1]), free)
        yield Speed("RS", free, axis_rate=free)
        return
    yield Speed("RM", SPEEDS["RM"])
    yield Speed("RS", float(model_speeds.max_speed))
    if model_speeds.has_max_speed:
        for fastest in range(model_speeds.max_speed_range[0], model_speeds.max_speed_range[1] + 1):
            yield Speed("RS", float(fastest), max_speed=fastest)


def _drive_speeds(model_speeds: ModelSpeeds, west_speed: float, drive: float) -> Iterator[Speed]:
    """Yield total speeds: of the drive alone, and with a direction key that adds to it. Degrees per second."""
    yield Speed(None, drive)
    if model_speeds.speeds:
        for sign in (1, -1):
            yield from (Speed(command, drive + sign * speed, west=sign > 0) for command, speed in model_speeds.speeds)
        return
    if model_speeds.guides:
        more = west_speed - drive
        arrow = next(_key_speeds(model_speeds, abs(more)))
        yield Speed("RG", drive + math.copysign(arrow.deg_per_s, more), guide=arrow.guide, west=more > 0.0)
    else:
        for sign in (1, -1):
            yield Speed("RG", drive + sign * SPEEDS["RG"], west=sign > 0)
    hertz = _nearest_hertz(model_speeds, west_speed)
    yield Speed(None, _speed(hertz), hertz=hertz)
    guide = SPEEDS["RG"]
    for sign in (1, -1):
        hertz = _nearest_hertz(model_speeds, west_speed - sign * guide)
        yield Speed(
            "RG", _speed(hertz) + sign * guide, guide=1.0 if model_speeds.guides else None, hertz=hertz, west=sign > 0
        )


def _nearest_hertz(model_speeds: ModelSpeeds, speed: float) -> float:
    low, high = model_speeds.hertz_range
    return min(high, max(low, round(speed * 3600.0 * SIDEREAL_HERTZ / SIDEREAL_ARCSEC_PER_S, 1)))


def _speed(hertz: float) -> float:
    """Return a drive rate in degrees per second; a telescope treats 60.1 to 60.2 hertz as sidereal."""
    if SIDEREAL_HERTZ_RANGE[0] <= hertz <= SIDEREAL_HERTZ_RANGE[1]:
        return SIDEREAL_ARCSEC_PER_S / 3600.0
    return hertz / SIDEREAL_HERTZ * SIDEREAL_ARCSEC_PER_S / 3600.0
