"""axe-core finds nothing in any view, by day, by night and in forced colours; arrow keys choose in a group."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import axe_playwright_python
import pytest

from tests.support.sampling import as_a_rule

from .page import DESK, PHONE, VIEWS, Visit

GRID = [("day", PHONE), ("night", DESK), ("forced", PHONE), ("day", DESK), ("night", PHONE), ("forced", DESK)]
AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text("utf-8")
FOUND = """async () => (await axe.run()).violations.map(one => `${one.id}: ${one.nodes.map(node =>
  `${node.target} ${node.any[0]?.message ?? ''}`).slice(0, 4).join(' | ')}`)"""


def test_arrow_keys_choose_in_a_group(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("more")
    page.page.get_by_role("radio", name="Day").focus()
    page.page.keyboard.press("ArrowRight")
    assert page.page.evaluate("[document.activeElement.textContent, document.documentElement.dataset.light]") == [
        "Red",
        "night",
    ]
    stops = page.page.evaluate("[...document.querySelectorAll('[aria-label=Light] button')].map(one => one.tabIndex)")
    assert stops == [-1, -1, 0], "Tab reaches the chosen one"


@pytest.mark.parametrize(("mode", "size"), GRID[: as_a_rule(3, whole=6)])
def test_axe_finds_nothing(visit: Callable[..., Visit], mode: str, size: tuple[int, int]) -> None:
    light = "night" if mode == "night" else "day"
    page = visit(size, light_mode=light, light_shown=light, light_step="4")
    if mode == "forced":
        page.page.emulate_media(forced_colors="active")
    page.find("Aldebaran")
    page.page.evaluate(AXE)
    faults = {}
    for view in VIEWS:
        page.show(view)
        if found := page.page.evaluate(FOUND):
            faults[view] = found
    page.show("sky")
    page.page.click("#sync")
    if found := page.page.evaluate(FOUND):
        faults["a question"] = found
    assert not faults
