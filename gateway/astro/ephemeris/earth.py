"""UT1-UTC: how far the turning of the Earth is from the clocks, day by day.

From finals2000A.all of the IERS, which astropy installs with itself (package astropy-iers-data) and which
holds a year of predictions. One column of it is kept, 160 kB; astropy's own reader takes 100 MB for the
whole. Fixed records: MJD in columns 8-15, UT1-UTC in columns 59-68. Never fetched, never refreshed.
"""

from __future__ import annotations

from array import array
from functools import cache
from pathlib import Path

import astropy_iers_data  # type: ignore[import-untyped]

_MJD_OF_UNIX_EPOCH = 40587
_MJD = slice(7, 15)
_UT1_UTC = slice(58, 68)


class EarthRotation:
    """UT1-UTC in seconds for every day of a table."""

    def __init__(self, records: bytes) -> None:
        lines = records.splitlines()
        self._first = int(float(lines[0][_MJD]))
        self._values = array("d")
        for number, line in enumerate(lines):
            if not line[_UT1_UTC].strip():
                break  # the last records are dates still without a prediction
            if int(float(line[_MJD])) != self._first + number:
                raise ValueError(f"UT1-UTC table: record {number + 1} is out of order")
            self._values.append(float(line[_UT1_UTC]))

    @classmethod
    @cache
    def installed(cls) -> EarthRotation:
        """The table that came with astropy, read once: nothing changes it while the gateway runs."""
        return cls(Path(astropy_iers_data.IERS_A_FILE).read_bytes())

    def ut1_utc(self, unix: float) -> float:
        """Seconds to add to UTC, as of 0h of the day (it moves by less than 3 ms a day).

        Before the table (1973) it is 0, after its end the last value holds.
        """
        day = int(unix // 86400.0) + _MJD_OF_UNIX_EPOCH - self._first
        if day < 0 or not self._values:
            return 0.0
        return self._values[min(day, len(self._values) - 1)]
