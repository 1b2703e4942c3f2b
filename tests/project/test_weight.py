"""What a gateway weighs: which packages it imports and when, and what a computer with little room needs."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Only the process that calculates the almanac imports these; PyYAML is astropy's own need.
FOR_ASTROPY = {"astropy", "astropy-iers-data", "numpy", "pyerfa"}


def _plain(requirement: str) -> str:
    match = re.match(r"[\w.-]+", requirement)
    assert match
    return match[0].lower().replace("_", "-")


def test_the_file_for_a_computer_with_little_room_lists_everything_but_astropy() -> None:
    """``--no-deps`` installs what is named and nothing else, so what the packages need is named too."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    named = {line for line in (ROOT / "docs/without-astropy.txt").read_text("utf-8").splitlines() if line[:1] != "#"}
    own = {line for line in project["dependencies"] if _plain(line) not in FOR_ASTROPY}
    assert own <= named
    needed, left = set(map(_plain, own)), list(map(_plain, own))
    while left:
        for line in requires(left.pop()) or []:
            name, _, marker = line.partition(";")
            if "extra ==" in marker or re.search(r"python_version\s*<\s*.3\.(\d|1[01])\b", marker):
                continue
            if "platform" not in marker and (name := _plain(name)) not in needed:
                needed.add(name)
                left.append(name)
    assert set(map(_plain, named)) == needed
