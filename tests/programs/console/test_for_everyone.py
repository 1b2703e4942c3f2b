"""axe-core finds nothing in any view, by day, by night and in forced colours; arrow keys choose in a group."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import axe_playwright_python
import pytest

from tests.support.sampling import as_a_rule

from .page import DESK, PHONE, VIEWS, Visit

SIDE, SMALL = (844, 390), (320, 568)
GRID = [("day", PHONE), ("night", DESK), ("forced", SIDE), ("night", SMALL)]
GRID += [
    (mode, size)
    for mode in ("day", "night", "forced")
    for size in (PHONE, DESK, SIDE, SMALL)
    if (mode, size) not in GRID
]
AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text("utf-8")
FOUND = """async () => (await axe.run()).violations.map(one => `${one.id}: ${one.nodes.map(node =>
  `${node.target} ${node.any[0]?.message ?? ''}`).slice(0, 4).join(' | ')}`)"""


def test_arrow_keys_choose_within_a_group_of_buttons(visit: Callable[..., Visit]) -> None:
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


#: Counts what changes in the regions that a screen reader reads out.
LISTEN = """() => {
  window.heard = [];
  const read = "[role=status], [role=alert], output, [aria-live=polite], [aria-live=assertive]";
  for (const one of document.querySelectorAll(read)) {
    if (one.ariaLive === "off") continue;
    const watch = new MutationObserver(() => window.heard.push(one.textContent));
    watch.observe(one, { subtree: true, childList: true, characterData: true });
  }
}"""


def test_screen_reader_announces_changes_of_state_but_not_each_position(visit: Callable[..., Visit]) -> None:
    page = visit(DESK, {"never": "told"})
    page.page.evaluate(LISTEN)
    for step in range(20):
        at = {"ra": 80 + step, "dec": 10, "ra2000": 80 + step, "dec2000": 10, "alt": 50, "az": 100 + step, "age": 0}
        before = page.text("#readings")
        page.hear_of_mount(position=at, sidereal=step)
        page.until("the position is shown", lambda before=before: page.text("#readings") != before)
    page.hear_of_mount(does="slewing", slewing=True, moves=True)
    page.until("it is announced", lambda: "Slewing" in page.page.evaluate("heard"))
    assert page.page.evaluate("heard") == ["Slewing"]


def test_reduced_motion_setting_disables_animations(visit: Callable[..., Visit]) -> None:
    page = visit(DESK)
    moving = (
        "[...document.querySelectorAll('*')].filter(one => (style => style.animationName !== 'none' || "
        "style.transitionDuration !== '0s' || style.scrollBehavior !== 'auto')(getComputedStyle(one))).length"
    )
    assert page.page.evaluate(moving) > 0
    page.page.emulate_media(reduced_motion="reduce")
    assert page.page.evaluate(moving) == 0


def asks(page: Visit) -> None:
    page.show("sky")
    page.page.fill("#object", "5.588 -5.39")
    page.page.press("#object", "Enter")


def mine(page: Visit) -> None:
    page.show("sky")
    page.page.click("#tonight-button")
    page.page.click("[data-kind=own]")
    page.page.click("#tonight summary")


def question(page: Visit, button: str) -> None:
    page.page.get_by_role("button", name=button).click()


STATES: dict[str, Callable[[Visit], None]] = {
    **{view: lambda page, view=view: page.show(view) for view in VIEWS},
    "fields": lambda page: question(page, "Narrow the limits…"),
    "mine": mine,
    "tonight": lambda page: page.page.click("[data-kind=all]"),
    "asks": asks,
    "card": lambda page: page.find("Aldebaran"),
    "sync": lambda page: page.page.click("#sync"),
}


@pytest.mark.parametrize(("mode", "size"), GRID[: as_a_rule(4, whole=len(GRID))])
def test_axe_finds_no_accessibility_fault_on_the_page(
    visit: Callable[..., Visit], mode: str, size: tuple[int, int]
) -> None:
    """Also of a mount that is not aligned; by night at the brightness that nobody has chosen yet."""
    light = "night" if mode == "night" else "day"
    page = visit(size, {'"aligned":true': '"aligned":false'}, light_mode=light, light_shown=light)
    page.page.emulate_media(forced_colors="active" if mode == "forced" else "none", reduced_motion="reduce")
    page.page.evaluate(AXE)
    faults = {}
    for state, reach in STATES.items():
        reach(page)
        if found := page.page.evaluate(FOUND):
            faults[state] = found
        if state == "fields":
            page.page.click("#ask-no")
    assert not faults
