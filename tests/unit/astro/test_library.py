"""The object library: numbers, searches, what is missing. Expected places are typed from printed catalogues."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from gateway.astro.catalog import deepsky, names, objects, stars
from gateway.astro.catalog.objects import QUALITIES, CatalogObject, SearchLimits, describe, quality
from gateway.astro.spherical import separation
from tests.support.each import each
from tests.support.sampling import as_a_rule

EVERYTHING = SearchLimits(-5.5, 20.0, 0, 200, "GPDCO", "VP")
#: catalogue, number, J2000 hours, minutes, degrees (decimal), kinds
PLACES = [
    ("M", 1, 5, 34.5, 22.02, "D"), ("M", 13, 16, 41.7, 36.46, "C"), ("M", 31, 0, 42.7, 41.27, "G"),
    ("M", 40, 12, 22.2, 58.08, "*"), ("M", 42, 5, 35.3, -5.39, "DO"), ("M", 45, 3, 47.5, 24.11, "O"),
    ("M", 57, 18, 53.6, 33.03, "P"), ("M", 101, 14, 3.2, 54.35, "G"), ("M", 102, 15, 6.5, 55.76, "G"),
    ("M", 110, 0, 40.4, 41.69, "G"), ("NGC", 7331, 22, 37.1, 34.42, "G"), ("NGC", 104, 0, 24.1, -72.08, "C"),
    ("IC", 342, 3, 46.8, 68.10, "G"), ("C", 14, 2, 20.5, 57.14, "O"), ("C", 41, 4, 26.9, 15.87, "O"),
    ("C", 80, 13, 26.8, -47.48, "C"), ("UGC", 454, 0, 42.7, 41.27, "G"),
]  # fmt: skip


@each(("catalog", "number", "hours", "minutes", "dec", "kinds"), PLACES)
def test_catalogue_number_gives_the_objects_position(
    catalog: str, number: int, hours: int, minutes: float, dec: float, kinds: str
) -> None:
    entry = deepsky.look_up(catalog, number)
    assert entry is not None
    assert entry.name == f"{catalog}{number}"
    assert entry.kinds == kinds
    assert separation(entry.ra, entry.dec, 15.0 * (hours + minutes / 60.0), dec) < 0.15  # the Hyades have no edge


def test_messier_caldwell_ngc_and_ic_catalogues_are_complete() -> None:
    for catalog, last, step in (("M", 110, 4), ("C", 109, 4), ("NGC", 7840, 391), ("IC", 5386, 391)):
        numbers = [*range(1, last, as_a_rule(step, whole=-(-step // 4))), last]
        assert [number for number in numbers if deepsky.look_up(catalog, number) is None] == []


@each(
    ("catalog", "number"),
    [("M", 0), ("M", 111), ("NGC", 7841), ("IC", 5387), ("C", 110), ("NGC", 999999), ("UGC", 99999)],
)
def test_number_outside_its_catalogue_is_unknown(catalog: str, number: int) -> None:
    assert deepsky.look_up(catalog, number) is None


def test_duplicate_catalogue_entry_has_its_originals_position() -> None:
    duplicate, original = deepsky.look_up("IC", 11), deepsky.look_up("NGC", 281)
    assert duplicate is not None
    assert original is not None
    assert (duplicate.ra, duplicate.dec, duplicate.size) == (original.ra, original.dec, original.size)
    assert duplicate.name == "IC11"


def test_proper_motion_is_applied_to_stars() -> None:
    barnard = stars.hipparcos_star(87937, 2000.0)  # J2000: 17 57 48.50 +04 41 36.2, moving 10.36" a year
    later = stars.hipparcos_star(87937, 2030.0)
    assert barnard is not None
    assert later is not None
    printed = 15 * (17 + 57 / 60 + 48.50 / 3600), 4 + 41 / 60 + 36.2 / 3600
    assert separation(barnard.ra, barnard.dec, *printed) < 0.5 / 3600
    assert separation(barnard.ra, barnard.dec, later.ra, later.dec) * 3600 == pytest.approx(30 * 10.36, rel=0.005)
    sirius = stars.hipparcos_star(32349, 2000.0)
    assert sirius is not None
    assert describe(sirius) == "HIP32349 STAR MAG-1.5"


@each("name", names.HIP_IDS)
def test_named_star_has_its_catalogue_position(name: str) -> None:
    number = names.HIP_IDS[name]
    found, entry = names.entry_of_star(number, 2026.9), stars.hipparcos_star(number, 2026.9)
    assert names.star_number(name.upper()) == number
    assert entry is not None
    assert separation(found.ra, found.dec, entry.ra, entry.dec) * 3600 < 0.02
    assert found.magnitude == pytest.approx(entry.magnitude, abs=0.01)


@pytest.mark.parametrize("number", [0, 55203, 120405, 2_000_000])
def test_star_missing_from_the_data_file_is_unknown(number: int) -> None:
    assert stars.hipparcos_star(number, 2000.0) is None


def test_first_and_last_star_of_the_catalogue_are_found() -> None:
    assert all(stars.hipparcos_star(number, 2000.0) for number in (1, 2, 120403, 120404))


@pytest.mark.parametrize(
    ("call"),
    [
        lambda: deepsky.look_up("M", 42),
        lambda: stars.hipparcos_star(1, 2000.0),
        lambda: deepsky.find_matches(EVERYTHING),
    ],
)
def test_missing_library_package_is_reported(call: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(objects, "find_spec", lambda name: None)
    with pytest.raises(objects.NotInstalled, match="Object library not installed"):
        call()  # type: ignore[operator]


# --- quality ------------------------------------------------------------------------------------------------------


def test_object_quality_grows_with_brightness_and_shrinks_with_spread() -> None:
    steps = [QUALITIES.index(quality(magnitude / 10.0, 1.0, 1.0)) for magnitude in range(160)]
    assert steps == sorted(steps)
    assert {QUALITIES[step] for step in steps} == set(QUALITIES)
    assert quality(8.0, 5.0, 5.0) == "VG"
    assert quality(8.0, 30.0, 30.0) == "GD"
    assert quality(None, 1.0, 1.0) == "VP"


def test_object_description_leaves_out_unmeasured_values() -> None:
    assert describe(CatalogObject("X1", "D", 0.0, 0.0)) == "X1 VP DIFF NEB"


# --- searching ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wanted",
    [
        SearchLimits(-5.5, 6.0, 0, 200, "GPDCO", "VP"),
        SearchLimits(9.0, 9.5, 0, 200, "GPDCO", "VP"),
        SearchLimits(-5.5, 12.0, 20, 40, "GPDCO", "VP"),
        SearchLimits(-5.5, 20.0, 0, 200, "P", "VP"),
        SearchLimits(-5.5, 20.0, 0, 200, "CO", "EX"),
        SearchLimits(-5.5, 20.0, 0, 200, "G", "GD"),
    ],
)
def test_object_search_finds_only_objects_within_its_size_and_magnitude_limits(wanted: SearchLimits) -> None:
    found = deepsky.find_matches(wanted)
    assert 3 < len(found) < 2000
    assert [deepsky.search_order(c) for c in found] == sorted(deepsky.search_order(c) for c in found)
    for candidate in found[:: max(1, len(found) // 15)]:
        entry = deepsky.object_by_row(candidate[0])
        assert (entry.ra, entry.dec) == pytest.approx(candidate[1:])
        assert wanted.min_mag <= (20.0 if entry.magnitude is None else entry.magnitude) <= wanted.max_mag
        assert wanted.min_size <= (entry.size or 0.0) <= wanted.max_size
        assert set(entry.kinds) & set(wanted.kinds)
        assert QUALITIES.index(quality(entry.magnitude, entry.size, entry.width)) <= QUALITIES.index(wanted.quality)


def test_object_search_by_quality_finds_every_match() -> None:
    best = {c[0] for c in deepsky.find_matches(SearchLimits(-5.5, 20.0, 0, 200, "GPDCO", "EX"))}
    bright = deepsky.find_matches(SearchLimits(-5.5, 9.0, 0, 200, "GPDCO", "VP"))
    assert best and best <= {c[0] for c in bright}
    entries = [(c[0], deepsky.object_by_row(c[0])) for c in bright[:: as_a_rule(3, whole=1)]]
    judged = [(quality(e.magnitude, e.size, e.width) in ("SU", "EX"), row in best) for row, e in entries]
    assert all(found == right for right, found in judged) and len(set(judged)) == 2


def test_object_search_without_an_object_type_finds_nothing() -> None:
    assert deepsky.find_matches(SearchLimits(-5.5, 20.0, 0, 200, "", "VP")) == []


def test_object_search_goes_once_round_the_sky_from_the_west() -> None:
    found = deepsky.find_matches(SearchLimits(-5.5, 6.0, 0, 200, "GPDCO", "VP"))
    start = deepsky.first_visible(found, lambda ra, dec: True, 100.0)
    assert start is not None
    assert start[1] // 15 == 18  # 280 degrees is the lower meridian
    seen, here = [start], start
    for _ in range(len(found) - 1):
        following = deepsky.neighbour(found, lambda ra, dec: True, here[1], here[2], 1)
        assert following is not None
        assert deepsky.neighbour(found, lambda ra, dec: True, following[1], following[2], -1) == here
        assert deepsky.search_order(following) > deepsky.search_order(here) or following == found[0]
        here = following
        seen.append(here)
    assert len(set(seen)) == len(found)
    assert deepsky.neighbour(found, lambda ra, dec: True, here[1], here[2], 1) == start


def test_object_search_skips_objects_where_gotos_are_forbidden() -> None:
    found = deepsky.find_matches(EVERYTHING)
    northern = deepsky.first_visible(found, lambda ra, dec: dec > 85.0, 0.0)
    assert northern is not None
    assert northern[2] > 85.0
    assert deepsky.first_visible(found, lambda ra, dec: False, 0.0) is None
    assert deepsky.neighbour([], lambda ra, dec: True, 0.0, 0.0, 1) is None


def test_field_search_keeps_its_radius_and_lists_the_nearest_first() -> None:
    found = deepsky.candidates_in_field(deepsky.find_matches(EVERYTHING), 83.82, -5.39, 0.5)
    assert deepsky.object_by_row(found[0][0]).name == "M42"
    distances = [separation(83.82, -5.39, c[1], c[2]) for c in found]
    assert distances == sorted(distances)
    assert max(distances) <= 0.5
    wrap = deepsky.candidates_in_field(deepsky.find_matches(EVERYTHING), 0.01, 0.0, 2.0)
    assert any(c[1] > 350.0 for c in wrap)
    assert math.isclose(max(abs(c[2]) for c in wrap), 2.0, abs_tol=0.5)


def test_catalogue_file_is_found_without_importing_its_package() -> None:
    path = objects.data_file("pyongc", "ongc.db")
    assert isinstance(path, Path)
    with pytest.raises(objects.NotInstalled):
        objects.data_file("pyongc", "nothing.db")
