"""What every installation knows: the files are what their script makes, and agree with the catalogues they are of."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import ModuleType

import pytest

from gateway.astro.catalog import deepsky, names, stars, supplied
from gateway.astro.spherical import separation
from tests.support import scripts
from tests.support.sampling import as_a_rule

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return scripts.script("docs/tools/make_catalogue.py")


def test_supplied_catalogue_files_match_the_output_of_their_script(script: ModuleType) -> None:
    for name in ("deepsky", "stars", "doubles"):
        written = supplied.sky_file(f"{name}.json").read_text("utf-8")
        assert written == script.text(name), "python docs/tools/make_catalogue.py makes it anew"


def test_supplied_catalogue_has_all_of_messier_and_caldwell_and_large_nebulae() -> None:
    known = supplied.deep_sky()
    assert [number for number in range(1, 111) if f"M{number}" not in known] == []
    assert [number for number in range(1, 110) if f"C{number}" not in known] == []
    for name in ("NGC7000", "NGC6960", "NGC6992", "IC434", "B33", "NGC1499", "NGC2237", "IC1805", "NGC891"):
        assert name in known
    entries = {id(entry): entry for entry in known.values()}
    assert 2700 < len(entries) < 2900
    assert json.loads(supplied.sky_file("deepsky.json").read_text("utf-8"))["about"]["licence"].startswith(
        "CC-BY-SA-4.0"
    )
    assert "ShareAlike 4.0" in supplied.sky_file(supplied.PAGE_FILES[2]).read_text("utf-8")


def test_supplied_objects_agree_with_the_full_catalogue() -> None:
    for name, entry in list(supplied.deep_sky().items())[:: as_a_rule(40, whole=1)]:
        catalogue = name.rstrip("0123456789")
        if catalogue in ("M", "NGC", "IC", "C"):
            whole = deepsky.look_up(catalogue, int(name.removeprefix(catalogue)))
            assert whole is not None
            assert separation(entry.ra, entry.dec, whole.ra, whole.dec) * 3600 < 0.1, name
            assert entry.kinds == whole.kinds


def test_supplied_double_stars_agree_with_hipparcos() -> None:
    """Their places, and their brightness: of both together, or of the brighter one where they stand apart."""
    rows = json.loads(supplied.sky_file("doubles.json").read_text("utf-8"))["rows"]
    assert len(rows) == 60 == len(supplied.double_star_texts())
    for called, number, ra, dec, first, second, apart, _ in rows:
        entry = stars.hipparcos_star(number, 2000.0)
        assert entry is not None and entry.magnitude is not None
        assert separation(entry.ra, entry.dec, ra, dec) * 3600 < 0.1, called
        together = -2.5 * math.log10(10 ** (-0.4 * first) + 10 ** (-0.4 * second))
        assert min(abs(entry.magnitude - light) for light in (first, together)) < 0.5, called
        assert 1.5 < apart < 400.0 and first - 0.2 <= second
        assert names.star_number(called.split("|")[0]) == number
