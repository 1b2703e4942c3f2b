"""The ten lines of safety in the README: each has tests that carry its number and prove it.

A test carries it as ``@pytest.mark.safety_line(NUMBER)``: whoever changes a line looks at its tests first, by
``pytest -m safety_line``.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tests.support.each import each

TOP = Path(__file__).resolve().parents[2]
SUBJECTS = {
    1: "stop",
    2: "mount-gateway stop",
    3: "altitudes",
    4: "Sun",
    5: "hour-angle-limit",
    6: "silent",
    7: "second process",
    8: "syncs",
    9: "reach",
    10: "you",
}


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
def test_readme_has_ten_safety_lines_on_the_expected_subjects() -> None:
    lines = written()
    assert list(lines) == list(SUBJECTS)
    assert all(subject in lines[number] for number, subject in SUBJECTS.items())


@each("number", list(SUBJECTS))
def test_each_safety_line_has_a_test_with_its_number(number: int) -> None:
    assert proofs().get(number)
