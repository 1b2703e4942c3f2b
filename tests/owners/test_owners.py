"""Every bundle replays as it was recorded, unless a reason why it does not is written down; the page lists them all."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest
import tomli

from gateway.app.recording.format import read
from gateway.astro.spherical import separation
from gateway.core.requests import decode
from gateway.diagnostics.prove.bundle import load, played
from gateway.diagnostics.prove.elsewhere import site_of
from gateway.diagnostics.prove.findings import DIFFERS
from tests.owners.simulated import FOLDER, KINDS, SITE
from tests.support.recovered import recovered
from tests.support.scripts import script

BUNDLES = sorted(FOLDER.glob("*.zip"))
CHANGED = tomli.loads((FOLDER / "changed.toml").read_text("utf-8"))


@pytest.mark.parametrize("bundle", BUNDLES, ids=lambda path: path.stem)
def test_a_mount_of_an_owner_is_driven_as_it_was(bundle: Path, tmp_path: Path) -> None:
    found = load(bundle, tmp_path)
    for name, then in found.played.items():
        recording = read(tmp_path / name)
        now = played(tmp_path / name)
        same_python = recording.settings["python"] == "{}.{}".format(*sys.version_info)
        if same_python and bundle.name not in CHANGED:
            assert now == then, f"{bundle.name} replays otherwise: if that is meant, say why in changed.toml"
        assert now.requests > 0


@pytest.mark.parametrize("bundle", BUNDLES, ids=lambda path: path.stem)
def test_a_simulated_mount_was_moved_and_nobody_recovers_where_it_stood(bundle: Path, tmp_path: Path) -> None:
    found = load(bundle, tmp_path)
    if found.by != "simulated":
        pytest.skip("only its owner knows where it stands")
    orders = Counter[str]()
    for name in found.played:
        orders.update(
            type(decode(event.data.decode())).__name__ for event in read(tmp_path / name) if event.arrow == "c"
        )
        sites = recovered(tmp_path / name, found.findings.model)
        assert sites
        assert min(separation(longitude, latitude, SITE[1], SITE[0]) for latitude, longitude in sites) >= 2.0
        told, _ = site_of(read(tmp_path / name), found.findings.model)
        assert told is not None  # and who works out the latitude from motions does not have the longitude
        assert separation(told[1], SITE[0], SITE[1], SITE[0]) >= 2.0
    assert orders["Press"] >= 8 and orders["Goto"] >= 3, orders
    assert {"motions", "goto", "program"} <= found.findings.stages.keys()
    assert not found.findings.of(DIFFERS)


def test_there_is_one_of_each_simulated_kind_and_no_reason_without_a_bundle() -> None:
    assert len(BUNDLES) >= len(KINDS)
    assert CHANGED.keys() <= {path.name for path in BUNDLES}
    assert all(len(reason) > 20 for reason in CHANGED.values())


def test_the_page_of_mounts_is_up_to_date() -> None:
    assert _page().PAGE.read_text("utf-8") == _page().page(), "run python docs/compatibility.py"


def _page() -> ModuleType:
    return script("docs/compatibility.py")
