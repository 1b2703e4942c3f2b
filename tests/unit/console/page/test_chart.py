"""The sky chart's arithmetic in JavaScript, held against the gateway's own astronomy and against plain geometry."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any

import pytest

from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from tests.support import exact_sky
from tests.support.each import each
from tests.unit.console.page.node import ask

MUNICH = (48.137, 11.575)
UNIX = datetime(2026, 11, 22, 20, 0, tzinfo=UTC).timestamp()
PHONE = {"width": 390, "height": 600}
#: Nutation and aberration, which the chart leaves out.
LEFT_OUT = 0.012


@pytest.fixture(scope="module")
def sky() -> Sky:
    exact = Sky()
    exact_sky.load(exact)
    return exact


def mount(sky: Sky, latitude: float = MUNICH[0], longitude: float = MUNICH[1], **more: Any) -> dict[str, Any]:
    """What the server tells, as far as the chart reads it."""
    site = {"latitude": latitude, "longitude": longitude}
    return {"index": 0, "site": site, "sidereal": sky.sidereal_time(UNIX, longitude), "bodies": [], **more}


PLACES = [(279.2347, 38.7837), (101.2872, -16.7102), (37.95, 89.26), (219.9, -60.83), (0.0, 0.0)]


@pytest.mark.parametrize(("latitude", "longitude"), [MUNICH, (-33.9, 151.2), (0.0, -78.0), (89.0, 0.0)])
def test_chart_places_stars_where_the_gateway_computes_them(sky: Sky, latitude: float, longitude: float) -> None:
    asked = [("overHorizon", mount(sky, latitude, longitude), UNIX, *place) for place in PLACES]
    for place, told in zip(PLACES, ask(*asked), strict=True):
        right = sky.az_alt(*sky.from_j2000(*place, UNIX), latitude, longitude, UNIX)
        assert separation(*told, *right) < LEFT_OUT


def test_chart_turns_the_sky_correctly_for_an_hour_of_silence(sky: Sky) -> None:
    [told] = ask(("later", mount(sky), 3600.0, UNIX + 3600.0, *PLACES[0]))
    right = sky.az_alt(*sky.from_j2000(*PLACES[0], UNIX + 3600.0), *MUNICH, UNIX + 3600.0)
    assert separation(*told, *right) < LEFT_OUT


def test_chart_precession_stays_accurate_over_a_century(sky: Sky) -> None:
    unix = datetime(2090, 1, 1, tzinfo=UTC).timestamp()
    for place, told in zip(PLACES, ask(*(("precessed", unix, *place) for place in PLACES)), strict=True):
        assert separation(*told, *sky.from_j2000(*place, unix)) < LEFT_OUT


@each(
    ("facing", "azimuth", "way"),
    [(180, 0, (0, -1)), (180, 90, (-1, 0)), (180, 180, (0, 1)), (180, 270, (1, 0)), (0, 0, (0, 1)), (90, 0, (-1, 0))],
)
def test_chart_shows_east_left_of_south(facing: float, azimuth: float, way: tuple[int, int]) -> None:
    shape = {**PHONE, "facing": facing}
    (x, y), told = ask(("point", shape, azimuth, 0.0), ("shape", shape))
    assert (x - 195.0, y - 300.0) == pytest.approx((way[0] * told["radius"], way[1] * told["radius"]), abs=1e-6)


def test_chart_has_the_zenith_in_its_middle_and_stereographic_rings() -> None:
    zenith, ring, (x, y) = ask(("point", PHONE, 77.0, 90.0), ("ring", PHONE, 30.0), ("point", PHONE, 180.0, 30.0))
    radius = 195.0 - 26.0
    assert zenith == pytest.approx([195.0, 300.0])
    assert ring == pytest.approx(radius * math.tan(math.radians(30.0)))
    assert [x, y] == pytest.approx([195.0, 300.0 + ring])


@pytest.mark.parametrize("altitude", [-3.0, -50.0, -89.0, -90.0])
def test_chart_shows_places_below_the_horizon_at_the_rim(altitude: float) -> None:
    """Under its azimuth, just outside of the circle, however deep it lies."""
    (x, y), just_above = ask(("atRim", PHONE, 270.0, altitude), ("atRim", PHONE, 270.0, 0.0))
    assert just_above == ask(("point", PHONE, 270.0, 0.0))[0]
    radius = just_above[0] - 195.0
    assert radius < math.hypot(x - 195.0, y - 300.0) < 1.05 * radius
    assert altitude == -90.0 or y == pytest.approx(300.0)


@pytest.mark.parametrize("facing", [180.0, 0.0, 123.0])
def test_tapped_chart_point_maps_back_to_the_drawn_place(facing: float) -> None:
    shape = {**PHONE, "facing": facing, "enlarged": [(3.0, 100.0, 200.0)], "panned": (20.0, -30.0)}
    places = [(10.0, 5.0), (200.0, 45.0), (359.0, 80.0), (90.0, 1.0)]
    points = ask(*(("point", shape, *place) for place in places))
    for place, told in zip(places, ask(*(("place", shape, *point) for point in points)), strict=True):
        assert separation(*told, *place) < 1e-6


def test_chart_zoom_keeps_the_place_under_the_finger() -> None:
    shape = {**PHONE, "enlarged": [(3.0, 220.0, 330.0)]}
    before, after, told = ask(("place", PHONE, 220.0, 330.0), ("place", shape, 220.0, 330.0), ("shape", shape))
    assert separation(*before, *after) < 1e-6
    assert told["zoom"] == 3.0


def test_chart_zoom_and_pan_are_bounded() -> None:
    closest, farthest, panned, still = ask(
        ("shape", {**PHONE, "enlarged": [(1000.0, 195.0, 300.0)]}),
        ("shape", {**PHONE, "enlarged": [(5.0, 100.0, 100.0), (0.001, 300.0, 300.0)]}),
        ("shape", {**PHONE, "enlarged": [(2.0, 195.0, 300.0)], "panned": (1e4, 0.0)}),
        ("shape", {**PHONE, "panned": (50.0, 50.0)}),
    )
    assert closest["zoom"] == 12.0
    assert (farthest["zoom"], farthest["left"], farthest["top"]) == (1.0, 0.0, 0.0)
    assert panned["left"] == pytest.approx(panned["scale"] - panned["radius"])
    assert (still["left"], still["top"]) == (0.0, 0.0)


@pytest.mark.parametrize("place", [(0.0, 0.0), (200.0, 89.9), (120.0, -40.0)])
def test_chart_circle_has_the_same_radius_all_around(place: tuple[float, float]) -> None:
    [told] = ask(("circle", *place, 20.0))
    assert told == pytest.approx([20.0] * 72)


def test_chart_lights_the_moon_from_the_suns_side() -> None:
    new, half, full, towards = ask(
        ("lit", 0.0), ("lit", 90.0), ("lit", 180.0), ("towards", PHONE, (180.0, 30.0), (270.0, 0.0))
    )
    assert (new, half, full) == pytest.approx((0.0, 0.5, 1.0), abs=1e-9)
    assert towards == pytest.approx(0.0, abs=0.6)  # in the south-west the Sun is to the right


def test_chart_tap_selects_star_planet_or_place(sky: Sky) -> None:
    here = mount(sky, bodies=[{"name": "Jupiter", "ra2000": 330.0, "dec2000": 10.0, "alt": None, "az": None}])
    where = ask(
        ("overHorizon", here, UNIX, 279.2347, 38.7837),
        ("overHorizon", here, UNIX, 330.0, 10.0),
        ("overHorizon", here, UNIX, 20.0, 60.0),
    )
    vega, jupiter, free = ask(*(("point", PHONE, *place) for place in where))
    on_vega, beside, on_jupiter, on_nothing, below = ask(
        ("picked", PHONE, here, UNIX, vega[0] + 6, vega[1] - 5, 24),
        ("picked", PHONE, here, UNIX, vega[0] + 6, vega[1] - 5, 2),
        ("picked", PHONE, here, UNIX, *jupiter, 14),
        ("picked", PHONE, here, UNIX, *free, 0.0),
        ("picked", PHONE, here, UNIX, 5, 5, 24),
    )
    assert (on_vega["name"], on_vega["ra2000"], on_vega["dec2000"]) == ("Vega", 279.2347, 38.7837)
    assert beside["name"] == ""
    assert on_jupiter["name"] == "Jupiter"
    assert on_nothing["name"] == "" and separation(on_nothing["ra2000"], on_nothing["dec2000"], 20.0, 60.0) < 1e-6
    assert below is None


def test_chart_tap_selects_nothing_while_the_site_is_unknown(sky: Sky) -> None:
    assert ask(("picked", PHONE, {**mount(sky), "site": None}, UNIX, 195, 300, 24)) == [None]


def test_chart_trail_grows_with_motion_and_expires() -> None:
    [told] = ask(("trail", [(100.0, 40.0, 0.0), (100.05, 40.0, 1.0), (101.0, 40.0, 2.0), (140.0, 40.0, 700.0)]))
    assert told == [1, 1, 2, 1]


def test_chart_trail_is_bounded() -> None:
    [told] = ask(("trail", [(step % 360, 40.0, step / 100) for step in range(5000)]))
    assert max(told) <= 600


def test_chart_draws_an_uncertain_mount_position_faintly(sky: Sky) -> None:
    points = mount(sky, position={"alt": 50.0, "az": 180.0})
    unsure = [{"aligned": False}, {"state": "down"}]
    sure, *others = ask(*(("opacity", PHONE, points | more) for more in ({"aligned": True, "state": "up"}, *unsure)))
    assert sure == [1, 1] and all(max(one) < 0.6 for one in others)


def test_chart_has_a_description_in_words(sky: Sky) -> None:
    bodies = [{"name": "Moon", "ra2000": 330.0, "dec2000": 10.0}, {"name": "Mars", "ra2000": 150.0, "dec2000": -10.0}]
    here = mount(sky, bodies=bodies, position={"alt": 41.2, "az": 283.0}, target={"alt": 10.0, "az": 44.0})
    told, lost = ask(("described", here, UNIX), ("described", {**here, "site": None, "position": None}, UNIX))
    assert "altitude 41°, azimuth 283° (west)" in told
    assert "altitude 10°, azimuth 44° (north-east)" in told
    assert "Above the horizon: Moon." in told
    assert "Where it points is not known yet." in lost and "no stars" in lost


def test_chart_places_the_name_of_a_target_beside_the_moon(sky: Sky) -> None:
    seen = mount(sky, bodies=[{"name": "Moon", "ra2000": 0.0, "dec2000": 40.0}])
    place = {"ra2000": 25.0, "dec2000": 40.0, "name": "M110"}
    [over] = ask(("overHorizon", seen, UNIX, 0.0, 40.0))
    (x, y), told = ask(("point", PHONE, *over), ("texts", PHONE, seen, UNIX, place, []))
    left, middle = told["M110"]
    assert abs(middle - y) > 8 + 6 or not x - 8 - 28 < left < x + 8


def test_chart_compass_letters_do_not_overlap_corner_figures(sky: Sky) -> None:
    """With the tube down, S may be where the declination stands: then it is written within the rim."""
    shape, dec = {**PHONE, "facing": 50}, [300.0, 150.0, 390.0, 188.0]
    place = {"ra2000": 0.0, "dec2000": 40.0, "name": ""}
    free, told = ask(*(("texts", shape, mount(sky), UNIX, place, covered) for covered in ([], [dec])))
    assert free["S"][0] + 7 > 300.0 and 150.0 < free["S"][1] < 188.0
    assert told["S"][0] + 7 < 300.0 or told["S"][1] > 188.0 + 15 / 2
    assert {name: at for name, at in told.items() if name != "S"} == {n: at for n, at in free.items() if n != "S"}


def test_chart_names_do_not_jump_during_rotation() -> None:
    right = [200.0, 290.0, 300.0, 310.0]
    assert ask(("sides", PHONE, [[], [right], [], []])) == [["right", "left", "left", "left"]]
