"""What is up tonight: six nights with their lists, held against astropy, and the formula that orders them."""

from __future__ import annotations

import json
import math
from datetime import UTC, datetime
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from gateway.astro.catalog import supplied
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.offline import go_offline
from gateway.console.page_session import night_positions
from tests.support.each import each
from tests.unit.console.page.node import ask

LIMITS = {"lowest": 15.0, "highest": 85.0}


class Evening(NamedTuple):
    """A night: where, when, how much of the Moon is lit when one looks, and the best that is to be seen."""

    name: str
    latitude: float
    longitude: float
    when: str
    lit: float
    best: list[str]


NIGHTS = [
    Evening("Berlin in winter", 52.5, 13.4, "2026-01-18 20:00", 0.00, ["M45", "M44", "M31", "NGC869", "NGC884"]),
    Evening("Sydney in winter", -33.9, 151.2, "2026-06-14 12:00", 0.01, ["M7", "NGC6231", "M24", "M6", "ESO56-115"]),
    Evening("Mauna Kea, full Moon", 19.8, -155.5, "2026-03-03 08:00", 1.00, ["M44", "M45", "M42", "NGC1980", "M47"]),
    Evening("Tromsø, no day", 69.6, 18.9, "2026-12-20 17:00", 0.84, ["M45", "NGC869", "M39", "NGC884", "M31"]),
    Evening("Quito, new Moon", -0.2, -78.5, "2026-04-17 03:00", 0.00, ["M44", "IC2391", "NGC6231", "M7", "NGC3532"]),
    Evening("Edinburgh in June", 55.9, -3.2, "2026-06-20 15:30", 0.40, ["Cl399", "M39", "M31", "NGC7000", "M13"]),
]
#: Of each list so many rows are held against astropy.
HELD = 40


def told(evening: Evening) -> tuple[dict[str, Any], float, dict[str, Any]]:
    """What the gateway tells of a mount there, the time, and its night."""
    sky, unix = Sky(), datetime.fromisoformat(evening.when).replace(tzinfo=UTC).timestamp()
    site = SimpleNamespace(latitude=evening.latitude, longitude=evening.longitude)
    sidereal = sky.sidereal_time(unix, evening.longitude)
    astrometry = SimpleNamespace(
        sky=sky, sidereal_time=lambda: sidereal, site_clock=SimpleNamespace(site=lambda: site, unix=lambda: unix)
    )
    controller: Any = SimpleNamespace(astrometry=astrometry, wire_log=SimpleNamespace(clock=lambda: unix))
    mount = {"index": 0, "site": vars(site), "sidereal": sidereal, "bodies": []}
    return mount, unix, night_positions(controller)


def objects() -> list[dict[str, Any]]:
    rows = json.loads(supplied.sky_file("deepsky.json").read_text("utf-8"))["rows"]
    doubles = json.loads(supplied.sky_file("doubles.json").read_text("utf-8"))["rows"]
    keys = ("kinds", "ra", "dec", "magnitude", "size", "width")
    return [{"names": names.split("|"), **dict(zip(keys, row, strict=True))} for names, *row in rows] + [
        {"names": names.split("|"), "kinds": "2", "ra": ra, "dec": dec, "magnitude": first, "size": apart / 60.0}
        for names, _, ra, dec, first, _, apart, _ in doubles
    ]


@pytest.mark.parametrize("evening", NIGHTS, ids=lambda evening: evening.name)
def test_tonight_list_matches_astropy_on_six_nights(evening: Evening) -> None:
    go_offline()
    from astropy.coordinates import AltAz, EarthLocation, SkyCoord, get_body
    from astropy.time import Time

    known = objects()
    mount, unix, sun_and_moon = told(evening)
    [found] = ask(("tonight", mount, unix, sun_and_moon, known, LIMITS))
    names = [name for name, *_ in found["list"]]
    assert names[:5] == evening.best
    assert [one[3] for one in found["list"]] == sorted((one[3] for one in found["list"]), reverse=True)
    assert found["lit"] == pytest.approx(evening.lit, abs=0.01)
    place = EarthLocation.from_geodetic(evening.longitude, evening.latitude)

    def altitude(where: Any, when: Any) -> Any:
        return where.transform_to(AltAz(obstime=Time(when, format="unix"), location=place)).alt.deg

    # The altitude of each at its best, and that it is at its best then.
    by_name = {one["names"][0]: one for one in known}
    rows = found["list"][:HELD]
    stars = SkyCoord(*([by_name[row[0]][key] for row in rows] for key in ("ra", "dec")), unit="deg")
    assert altitude(stars, [row[2] for row in rows]) == pytest.approx([row[1] for row in rows], abs=1.0 / 60.0)
    assert all(LIMITS["lowest"] - 0.02 <= row[1] <= LIMITS["highest"] + 0.02 for row in found["list"])
    assert all(found["from"] <= row[2] <= found["from"] + 7200 for row in found["list"])
    # When they stand in the meridian, to a minute; aberration alone moves Polaris by more.
    transits = ask(*(("culmination", mount, unix, by_name[row[0]]["ra"], by_name[row[0]]["dec"]) for row in rows))
    times = Time([one["unix"] for one in transits], format="unix", location=place)
    seen = stars.transform_to(AltAz(obstime=times, location=place))
    for az, alt, dec in zip(seen.az.rad, seen.alt.rad, stars.dec.rad, strict=True):
        if abs(dec) < math.radians(85.0):
            assert abs(math.asin(math.sin(az) * math.cos(alt) / math.cos(dec))) < math.radians(0.25)
    assert [one["altitude"] for one in transits] == pytest.approx(list(seen.alt.deg), abs=0.05)
    for star, one in zip(stars, transits, strict=True):
        for event in ("rises", "sets"):
            assert one[event] is None or altitude(star, one[event]) == pytest.approx(0.0, abs=0.05)
    assert any(one["sets"] is not None for one in transits)
    # Sun and Moon through the night.
    hours = [sun_and_moon["begins"] + 3600.0 * hour for hour in range(17)]
    for body in ("sun", "moon"):
        drawn = ask(*(("altitudeOf", mount, unix, sun_and_moon, body, hour) for hour in hours))
        right = altitude(get_body(body, Time(hours, format="unix"), place), hours)
        assert drawn == pytest.approx(list(right), abs=0.15)


@each(
    ("when", "order"),
    [
        ("2026-01-18 20:00", ["Jupiter", "M31", "M42", "NGC1980"]),
        ("2026-01-27 20:00", ["Jupiter", "M42", "NGC1980"]),
        ("2026-10-10 20:00", ["M31", "IC1805"]),
        ("2026-10-25 20:00", ["M31", "IC1805"]),
    ],
)
def test_tonight_list_puts_easy_objects_first(when: str, order: list[str]) -> None:
    """With and without the Moon: planets and Messier's objects before fainter neighbours of theirs."""
    mount, unix, sun_and_moon = told(NIGHTS[0]._replace(when=when))
    jupiter = {"names": ["Jupiter"], "kinds": "planet", "ra": 109.0, "dec": 22.3, "magnitude": -2.3, "size": None}
    [found] = ask(("tonight", mount, unix, sun_and_moon, [*objects(), jupiter], LIMITS))
    assert [name for name, *_ in found["list"] if name in order] == order


def test_tonight_list_leaves_out_objects_near_the_sun_or_past_the_meridian() -> None:
    """In a night without darkness; an equatorial mount that cannot change the side of its pier."""
    go_offline()
    from astropy.coordinates import TETE, AltAz, EarthLocation, SkyCoord, get_body
    from astropy.time import Time

    mount, unix, sun_and_moon = told(Evening("Tromsø", 69.6, 18.9, "2026-06-20 20:00", 0.0, []))
    known = objects()
    limits: dict[str, Any] = {**LIMITS, "sun": 40.0, "hour_angle": 30.0}
    all_, right = ask(*(("tonight", mount, unix, sun_and_moon, known, one) for one in (LIMITS, limits)))
    by_name = {one["names"][0]: one for one in known}
    place = EarthLocation.from_geodetic(18.9, 69.6)

    def allowed(rows: list[Any]) -> Any:
        stars = SkyCoord(*([by_name[row[0]][key] for row in rows] for key in ("ra", "dec")), unit="deg")
        times = Time([row[2] for row in rows], format="unix")
        frame = AltAz(obstime=times, location=place)
        seen, sun = (body.transform_to(frame) for body in (stars, get_body("sun", times)))
        angle = times.sidereal_time("apparent", 18.9).deg - stars.transform_to(TETE(obstime=times)).ra.deg
        return (seen.separation(sun).deg > 39.5) & (abs((angle + 180.0) % 360.0 - 180.0) < 30.5)

    assert not allowed(all_["list"]).all() and allowed(right["list"]).all() and len(right["list"]) > 50


def test_tonight_list_in_the_afternoon_is_that_of_the_evening() -> None:
    """In the afternoon the list is that of the evening; in steps of ten minutes it stays the same."""
    hours = {"2026-06-20 15:30": 22, "2026-06-20 16:35": 22, "2026-06-20 23:08": 23}
    found = []
    for when in hours:
        mount, unix, sun_and_moon = told(NIGHTS[-1]._replace(when=when))
        found += ask(("tonight", mount, unix, sun_and_moon, objects()[:200], LIMITS))
    assert [datetime.fromtimestamp(one["from"], UTC).hour for one in found] == list(hours.values())
    assert found[0]["from"] == found[1]["from"] and found[2]["from"] % 600 == 0
    assert [row[0] for row in found[0]["list"]] == [row[0] for row in found[1]["list"]]


@pytest.mark.parametrize("hour", range(0, 24, 3))
def test_tonight_list_switches_to_the_next_night_in_the_morning(hour: int) -> None:
    mount, unix, sun_and_moon = told(NIGHTS[0]._replace(when=f"2026-03-20 {hour:02d}:30"))
    middle = sun_and_moon["begins"] + 8 * 3600.0
    assert -8 * 3600.0 < middle - unix <= 16 * 3600.0
    depths = ask(*(("altitudeOf", mount, unix, sun_and_moon, "sun", middle + 3600.0 * aside) for aside in (-2, 0, 2)))
    assert depths[1] == min(depths) < -30.0


@each(
    ("better", "worse"),
    [
        (({"kinds": "G", "magnitude": 8.0}, 60.0, 0.0), ({"kinds": "G", "magnitude": 8.0}, 30.0, 0.0)),
        (({"kinds": "G", "magnitude": 8.0}, 60.0, 0.0), ({"kinds": "G", "magnitude": 9.0}, 60.0, 0.0)),
        (({"kinds": "O", "magnitude": 8.0, "size": 30.0}, 60.0, 0.0), ({"kinds": "O", "magnitude": 8.0}, 60.0, 0.0)),
        (({"kinds": "C", "magnitude": 8.0}, 60.0, 2.0), ({"kinds": "G", "magnitude": 8.0}, 60.0, 2.0)),
        (({"kinds": "P", "magnitude": 8.0}, 60.0, 0.0), ({"kinds": "P", "magnitude": 8.0}, 60.0, 2.0)),
        (({"kinds": "O", "magnitude": 8.0}, 60.0, 0.0), ({"kinds": "O"}, 60.0, 0.0)),
    ],
)
def test_tonight_order_prefers_high_bright_large_objects_with_little_moonlight(better: Any, worse: Any) -> None:
    one, other = ask(("worth", *better), ("worth", *worse))
    assert one > other


def test_tonight_order_ignores_moonlight_for_double_stars() -> None:
    double = {"kinds": "2", "magnitude": 3.0}
    assert len(set(ask(("worth", double, 50.0, 0.0), ("worth", double, 50.0, 3.0)))) == 1
