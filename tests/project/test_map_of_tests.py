"""docs/testing.md leads from a part of the gateway to its unit tests: those named after a module need no row."""

from __future__ import annotations

import re

from tests.support.pages import ROOT

UNIT, GATEWAY = ROOT / "tests" / "unit", ROOT / "gateway"
ROW = re.compile(r"^\| `gateway/([\w/]*)` \| (.+) \|$", re.M)


def test_every_unit_test_is_named_after_a_module_or_stands_in_the_map() -> None:
    rows = ROW.findall((ROOT / "docs" / "testing.md").read_text("utf-8"))
    listed = sorted(f"{folder}/{name}" for folder, names in rows for name in re.findall(r"`test_(\w+)`", names))
    others = []
    for path in sorted(UNIT.rglob("test_*.py")):
        folder = path.parent.relative_to(UNIT)
        modules = {module.stem for module in (GATEWAY / folder).rglob("*.py")}
        if path.stem.removeprefix("test_") not in modules:
            others.append(f"{folder}/{path.stem.removeprefix('test_')}")
    assert listed == sorted(others)
