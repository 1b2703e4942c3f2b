"""The ten lines of safety in the README: each has tests that carry its number and prove it.

A test carries it as ``@pytest.mark.safety_line(NUMBER)``. The lines are typed here once more, so that whoever changes
one looks at its tests: ``pytest -m safety_line``.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.support.each import each

TOP = Path(__file__).resolve().parents[2]
LINES = {
    1: "A stop from any program goes to the mount before everything else and is repeated until the mount is seen at "
    "rest.",
    2: "`mount-gateway stop` stops every mount from any terminal. Ctrl-C, SIGTERM and a closed terminal stop what the "
    "gateway has set moving.",
    3: "Gotos and motion by hand keep to the altitudes between 0° and 90°, or to `lowest` and `highest` if you set "
    "them; the mount's own keys only if you set them.",
    4: "While the Sun is up, no goto leads nearer to it than 20°, and motion that comes nearer is stopped.",
    5: "The tube of a German mount is kept from the pier only if you set `hour-angle-limit`.",
    6: "Fast motion by hand stops if the program that started it is silent for 30 s. Gotos continue.",
    7: "If the gateway is killed or hangs while the mount moves, a second process stops the mount (on Linux and "
    "macOS, not on Windows).",
    8: "Syncs that turn the sky or an axis by more than 15°, alone or together, are refused, except the first one of a "
    "Meade, those that take earlier ones back, and by night those of up to 1° on the sky. A Celestron that is not "
    "aligned accepts no goto.",
    9: "Everyone who can reach the port can move the mount. Only this computer can, until you write another address.",
    10: "None of this replaces you: stay near the mount while it moves.",
}  # fmt: skip


def written() -> dict[int, str]:
    """Return the lines of the README by number."""
    text = (TOP / "README.md").read_text("utf-8")
    part = text.partition("## Safety in ten lines\n")[2].partition("\n[docs/safety.md]")[0]
    items = re.findall(r"^(\d+)\. (.*?)(?=^\d+\. |\Z)", part.strip() + "\n", re.MULTILINE | re.DOTALL)
    return {int(number): " ".join(words.split()) for number, words in items}


def proofs() -> dict[int, list[str]]:
    """Return the tests that carry each number."""
    found: dict[int, list[str]] = {}
    for path in sorted((TOP / "tests").rglob("test_*.py")):
        text = path.read_text("utf-8")
        if "safety_line(" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                for mark in node.decorator_list:
                    if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.safety_line":
                        found.setdefault(ast.literal_eval(mark.args[0]), []).append(f"{path.name}::{node.name}")
    return found


@pytest.mark.safety_line(10)
def test_the_readme_says_exactly_these_lines() -> None:
    assert written() == LINES


@each("number", list(LINES))
def test_each_line_has_a_test_that_carries_its_number(number: int) -> None:
    assert proofs().get(number)
