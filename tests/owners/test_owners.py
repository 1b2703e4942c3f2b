"""Every bundle replays as it was recorded, unless a reason why it does not is written down; the page lists them all."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest
import tomli

from gateway.app.recording.format import read
from gateway.diagnostics.prove.bundle import load, played
from tests.owners.simulated import FOLDER, KINDS
from tests.support.sampling import as_a_rule
from tests.support.scripts import script

BUNDLES = sorted(FOLDER.glob("*.zip"))
CHANGED = tomli.loads((FOLDER / "changed.toml").read_text("utf-8"))


@pytest.mark.parametrize("bundle", as_a_rule(BUNDLES[::5], whole=BUNDLES), ids=lambda path: path.stem)
def test_a_mount_of_an_owner_is_driven_as_it_was(bundle: Path, tmp_path: Path) -> None:
    found = load(bundle, tmp_path)
    for name, then in found.played.items():
        recording = read(tmp_path / name)
        now = played(tmp_path / name)
        same_python = recording.settings["python"] == "{}.{}".format(*sys.version_info)
        if same_python and bundle.name not in CHANGED:
            assert now == then, f"{bundle.name} replays otherwise: if that is meant, say why in changed.toml"
        assert now.requests > 0


def test_there_is_one_of_each_simulated_kind_and_no_reason_without_a_bundle() -> None:
    assert len(BUNDLES) >= len(KINDS)
    assert CHANGED.keys() <= {path.name for path in BUNDLES}
    assert all(len(reason) > 20 for reason in CHANGED.values())


def test_the_page_of_mounts_is_up_to_date() -> None:
    assert _page().PAGE.read_text("utf-8") == _page().page(), "run python docs/compatibility.py"


def _page() -> ModuleType:
    return script("docs/compatibility.py")
