"""Skyfield with JPL's DE421 as an independent reference for the sky, with the same IERS table for both.

Angles are degrees, separations arcseconds. Skyfield reads finals2000A.all with its own parser, so that its UT1 is
agrees with ours only if both read it right. It includes polar motion, which the gateway leaves out. DE421 ends in 2053.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import wrap180

api = pytest.importorskip("skyfield.api")
iers = pytest.importorskip("skyfield.data.iers")
astropy_iers_data = pytest.importorskip("astropy_iers_data")

Array = np.ndarray[Any, Any]


def timescale() -> tuple[Any, Any]:
    """Return Skyfield's time scale from the IERS table that the gateway reads, and the rows as Skyfield reads them."""
    with open(astropy_iers_data.IERS_A_FILE, "rb") as file:
        rows = iers.parse_x_y_dut1_from_finals_all(file)
    daily_tt, daily_delta_t, leap_dates, leap_offsets = iers.build_timescale_arrays(rows["utc_mjd"], rows["dut1"])
    scale = api.Timescale((daily_tt, daily_delta_t), leap_dates, leap_offsets)
    iers.install_polar_motion_table(scale, rows)
    return scale, rows


def drawn(dice: np.random.Generator, first: float, last: float, count: int) -> Array:
    """Return ``count`` random moments on a quarter as many days, because each new day costs astropy milliseconds."""
    days = dice.uniform(first, last, (count + 3) // 4)
    return np.clip((days - days % 86400.0).repeat(4)[:count] + dice.uniform(0.0, 86400.0, count), first, last)


def ephemeris() -> Any:
    """Return DE421 from the package skyfield-data, whose own path function warns of tables that are not used here."""
    found = find_spec("skyfield_data")
    if found is None or found.origin is None:
        pytest.skip("skyfield-data is not installed")
    return api.load_file(str(Path(found.origin).parent / "data" / "de421.bsp"))


def at(scale: Any, moments: Array) -> Any:
    """Convert Unix times to Skyfield's, counting days in UTC as leap seconds demand."""
    return scale.utc(1970, 1, 1 + moments // 86400.0, 0, 0, moments % 86400.0)


def angles(vectors: Array) -> Array:
    """Return two rows, longitude and latitude, of columns x, y, z."""
    x, y, z = vectors
    return np.array([np.degrees(np.arctan2(y, x)) % 360.0, np.degrees(np.arctan2(z, np.hypot(x, y)))])


def turned(matrices: Array, ra: Array, dec: Array) -> Array:
    """Rotate each direction by its own matrix."""
    a, d = np.radians(ra), np.radians(dec)
    vectors = np.array([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)])
    return angles(np.einsum("ijn,jn->in", matrices, vectors))


def apparent(seen_from: Any, t: Any, body: Any) -> tuple[Array, Array]:
    """Return (ra and dec of date, distance in km), with light time, aberration and deflection."""
    ra, dec, distance = seen_from.at(t).observe(body).apparent().radec("date")
    return np.array([ra.hours * 15.0, dec.degrees]), distance.km


def ours(function: Callable[..., tuple[float, ...]], *columns: Array) -> Array:
    """Call the gateway's scalar function for each row; return its answers as columns."""
    return np.array([function(*map(float, row)) for row in zip(*columns, strict=True)]).T


def apart(found: Array, right: Array) -> Array:
    """Return separations on the sky, in arcseconds."""
    a, b, c, d = np.radians(np.array([*found[:2], *right[:2]]))
    haversine = np.sin((d - b) / 2.0) ** 2 + np.cos(b) * np.cos(d) * np.sin((c - a) / 2.0) ** 2
    return np.degrees(2.0 * np.arcsin(np.sqrt(haversine))) * 3600.0


def sidereal_error(sky: Sky, moments: Array, longitudes: Array, gast_hours: Array) -> Array:
    """Return the signed errors in seconds of time."""
    rows = zip(moments, longitudes, gast_hours, strict=True)
    return np.array([wrap180(sky.sidereal_time(float(m), float(lon)) - lon - 15.0 * g) * 240.0 for m, lon, g in rows])


def rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
