"""The chart's data file is what its script makes of the catalogue, and says where it comes from."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import pytest

from gateway.astro.spherical import separation
from tests.support import scripts

ROOT = Path(__file__).resolve().parents[4]
DATA = ROOT / "gateway/console/page/data"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    return scripts.script("docs/tools/make_sky_data.py")


def test_chart_star_file_matches_the_output_of_its_script(script: ModuleType) -> None:
    assert (DATA / "stars.json").read_text("utf-8") == script.text(), "python docs/tools/make_sky_data.py makes it anew"


def test_chart_star_file_has_88_figures_of_plausible_size(script: ModuleType) -> None:
    told = json.loads((DATA / "stars.json").read_text("utf-8"))
    stars, figures = told["stars"], told["figures"]
    assert len({name for name, *_ in figures}) == 88
    for name, ra, dec, lines in figures:
        for line in lines:
            for one, next_ in pairwise(line):
                assert separation(*stars[one][:2], *stars[next_][:2]) < 32.0, name
            assert min(separation(*stars[star][:2], ra, dec) for star in line) < 45.0, name


def test_chart_star_file_lists_bright_stars_first_and_names_well_known_ones(script: ModuleType) -> None:
    stars = json.loads((DATA / "stars.json").read_text("utf-8"))["stars"]
    assert [row[2] for row in stars] == sorted(row[2] for row in stars)
    visual = {"Sirius": -1.46, "Canopus": -0.74, "Arcturus": -0.05, "Rigil Kentaurus": -0.01, "Vega": 0.03}
    assert [row[4] for row in stars[:5]] == list(visual), "by V, as observers know them, not by Hipparcos's own band"
    assert [row[2] for row in stars[:5]] == pytest.approx(list(visual.values()), abs=0.02)
    assert all(len(row) == 5 for row in stars[:30])


def test_chart_star_file_names_sources_and_licences() -> None:
    about = json.loads((DATA / "stars.json").read_text("utf-8"))["about"]
    assert "Hipparcos" in about["stars"] and "BSD-3-Clause" in about["figures"]
    assert "Copyright (c) 2015, Olaf Frohn" in (DATA / "LICENSE-d3-celestial.txt").read_text("utf-8")
    assert "d3-celestial" in (ROOT / "docs/developers.md").read_text("utf-8")
