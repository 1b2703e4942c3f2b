"""UT1-UTC: how far the turning of the Earth is from the clocks, day by day, as the table astropy asks for it.

From finals2000A.all of the IERS, which astropy installs with itself (package astropy-iers-data) and which holds a year
of predictions. astropy's own reader takes 100 MB for the whole; this takes one column and leaves polar motion (0.6")
out. Fixed records: MJD in columns 8-15, UT1-UTC in columns 59-68. Never fetched, never refreshed.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

import astropy_iers_data  # type: ignore[import-untyped]
import numpy as np
from astropy import units as u
from astropy.utils.iers import IERS


def read(records: Iterable[bytes]) -> IERS:
    """A table for all dates: 0 before the first record, after the last prediction its value holds."""
    rows = ((line[7:15], line[58:68]) for line in records)
    days, values = zip(*((float(day), float(value)) for day, value in rows if value.strip()), strict=True)
    if (np.diff(days) != 1.0).any():
        raise ValueError("UT1-UTC table: its days do not follow one another")
    table = {"MJD": [0.0, days[0] - 1.0, *days, 1e5] * u.day, "UT1_UTC": [0.0, 0.0, *values, values[-1]] * u.s}
    still = np.zeros(len(days) + 3) * u.arcsec
    return IERS({**table, "PM_x": still, "PM_y": still, "dX_2000A": still, "dY_2000A": still})


@cache
def installed() -> IERS:
    """The table that came with astropy, read once: nothing changes it while the gateway runs."""
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        return read(file)
