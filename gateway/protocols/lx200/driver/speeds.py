"""Which of its speeds a Meade comes nearest with, in ratio, to one that was asked for.

Asked is either a speed on the sky or of an axis, or what the motor in right ascension is to turn at altogether, instead
of tracking: then the drive rate, and guiding that adds to it, count as well. What the choice changes on the telescope
(``:Sw :RA :RE :Rg``, the drive rate) is put back when the motion is over (``ends.py``).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import SIDEREAL_ARCSECONDS

#: Hertz of the sidereal rate, by which drive rates are counted; what of them counts as sidereal.
SIDEREAL_HERTZ, SIDEREAL_SHOWN = 60.16427, (60.1, 60.2)
#: The four rates in degrees a second, as their manual says: 1x, 16x, 2 and 8 degrees a second.
SPEEDS = {"RG": SIDEREAL_ARCSECONDS / 3600, "RC": 16 * SIDEREAL_ARCSECONDS / 3600, "RM": 2.0, "RS": 8.0}
#: Two ratios that differ by less are alike: then the simpler way is taken.
ALIKE = 1e-4
#: The slowest of :RA and :RE, degrees a second, and of :Rg, arcseconds a second: one in the last digit.
_FREE_FROM, _FREE_STEP, _GUIDE_STEP = 0.1, 0.1, 0.1


class Speed(Struct, frozen=True):
    """``command`` is the rate of the arrow, None where none is pressed; ``degrees`` what comes of it, degrees a second.

    ``guide`` is what :RG is to mean, a fraction of sidereal; ``fastest`` is for :Sw, ``free`` for :RA or :RE, degrees a
    second; ``hertz`` is the drive rate, None for the one that runs. ``west`` is the sense of an arrow in the first axis
    where that is not the one asked for.
    """

    command: str | None
    degrees: float
    guide: float | None = None
    fastest: int | None = None
    free: float | None = None
    hertz: float | None = None
    west: bool | None = None


class Abilities(Struct, frozen=True):
    """What a model has: :Rg, :RA and :RE, :Sw; its ordinary fastest rate and its range; its drive rates, hertz."""

    guides: bool
    free: bool
    limits: bool
    fastest: int
    range: tuple[int, int]
    hertz: tuple[float, float]


def off(asked: float, done: float) -> float:
    """How far apart two speeds are in ratio, as a logarithm; without end where one goes the other way or rests."""
    if asked == done:
        return 0.0
    return abs(math.log(done / asked)) if asked * done > 0.0 else math.inf


def nearest(able: Abilities, degrees: float) -> Speed:
    """The arrow's speed that is nearest to so many degrees a second."""
    return _best([*_arrows(able, degrees)], degrees)


def instead_of_tracking(able: Abilities, west: float, drive: float) -> Speed:
    """What turns the motor in right ascension nearest to ``west`` degrees a second, which may be negative.

    ``drive`` is the drive rate that runs, degrees a second.
    """
    return _best(
        [
            *_drives(able, west, drive),
            *(
                replace(speed, degrees=math.copysign(speed.degrees, west))
                for speed in _arrows(able, abs(west))
                if speed.command != "RG"
            ),
        ],
        west,
    )


def _best(speeds: list[Speed], asked: float) -> Speed:
    """The first of those that come nearest."""
    least = min(off(asked, speed.degrees) for speed in speeds)
    return next(speed for speed in speeds if off(asked, speed.degrees) <= least + ALIKE)


def _arrows(able: Abilities, degrees: float) -> Iterator[Speed]:
    """The simple ones first."""
    if able.guides:
        arcseconds = min(
            math.floor(SIDEREAL_ARCSECONDS / _GUIDE_STEP) * _GUIDE_STEP, max(_GUIDE_STEP, degrees * 3600.0)
        )
        arcseconds = round(round(arcseconds / _GUIDE_STEP) * _GUIDE_STEP, 1)
        yield Speed("RG", arcseconds / 3600.0, guide=arcseconds / SIDEREAL_ARCSECONDS)
    else:
        yield Speed("RG", SPEEDS["RG"])
    yield Speed("RC", SPEEDS["RC"])
    if able.free:
        free = min(float(able.range[1]), max(_FREE_FROM, round(round(degrees / _FREE_STEP) * _FREE_STEP, 1)))
        yield Speed("RS", free, free=free)
        return
    yield Speed("RM", SPEEDS["RM"])
    yield Speed("RS", float(able.fastest))
    if able.limits:
        for fastest in range(able.range[0], able.range[1] + 1):
            yield Speed("RS", float(fastest), fastest=fastest)


def _drives(able: Abilities, west: float, drive: float) -> Iterator[Speed]:
    """Tracking at another rate, with and without an arrow that adds to it."""
    yield Speed(None, drive)
    if able.guides:
        more = west - drive
        arrow = next(_arrows(able, abs(more)))
        yield Speed("RG", drive + math.copysign(arrow.degrees, more), guide=arrow.guide, west=more > 0.0)
    else:
        for sign in (1, -1):
            yield Speed("RG", drive + sign * SPEEDS["RG"], west=sign > 0)
    hertz = _hertz(able, west)
    yield Speed(None, _speed(hertz), hertz=hertz)
    guide = SPEEDS["RG"]
    for sign in (1, -1):
        hertz = _hertz(able, west - sign * guide)
        yield Speed("RG", _speed(hertz) + sign * guide, guide=1.0 if able.guides else None, hertz=hertz, west=sign > 0)


def _hertz(able: Abilities, degrees: float) -> float:
    low, high = able.hertz
    return min(high, max(low, round(degrees * 3600.0 * SIDEREAL_HERTZ / SIDEREAL_ARCSECONDS, 1)))


def _speed(hertz: float) -> float:
    """Degrees a second of a drive rate; a telescope takes 60.1 to 60.2 for sidereal."""
    if SIDEREAL_SHOWN[0] <= hertz <= SIDEREAL_SHOWN[1]:
        return SIDEREAL_ARCSECONDS / 3600.0
    return hertz / SIDEREAL_HERTZ * SIDEREAL_ARCSECONDS / 3600.0
