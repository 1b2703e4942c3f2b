"""Steps with the arrows, and a search in a spiral: one goto a tap, which ends by itself."""

from __future__ import annotations

from collections.abc import Callable

from ..sky import Spot, separation
from .page import Console, Visit

#: The telescope and eyepiece that this browser keeps.
HALF_A_DEGREE = '{"telescope": 2000, "eyepiece": 20, "apparent": 50}'


def is_away(console: Console, start: Spot, minutes: float) -> bool:
    """Whether the mount itself points so far from where it pointed, to 1.5 minutes of arc."""
    return abs(separation(console.truth.position(), start) * 60.0 - minutes) < 1.5


def test_a_tap_is_a_step(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit(optics=HALF_A_DEGREE)
    page.show("control")
    for minutes, step, arrow in ((5.0, "5′", "north"), (30.0, "Field", "west")):
        page.page.get_by_role("radio", name=step).click()
        console.at_rest()
        page.until("it tracks", lambda: page.does("Tracking"))
        before = console.truth.position()
        box = page.page.locator(f"[data-go={arrow}]").bounding_box()
        assert box is not None
        page.page.mouse.move(box["x"] + 20, box["y"] + 20)
        page.page.mouse.down()  # and it is held: a step is no more than a step
        page.until(
            "it is there", lambda way=minutes, at=before: abs(separation(console.truth.position(), at) * 60 - way) < 1
        )
        page.page.wait_for_timeout(600)
        console.at_rest()
        assert is_away(console, before, minutes)
        page.page.mouse.up()


def test_a_search_goes_one_place_further_with_each_tap(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit(optics=HALF_A_DEGREE)
    page.show("control")
    console.at_rest()
    start = console.truth.position()
    page.page.get_by_role("button", name="Search…").click()
    for number, minutes in ((2, 30.0), (3, 42.4)):
        page.until("the next is offered", lambda place=number: page.text("#spiral-next") == f"Place {place}")
        page.until("it is there", lambda way=minutes: is_away(console, start, way))
        page.until("it tracks", lambda: page.does("Tracking"))
        if number == 2:
            page.page.click("#spiral-next")
    page.page.get_by_role("button", name="Back").click()
    page.until("it is back", lambda: separation(console.truth.position(), start) * 60 < 1)
    page.page.get_by_role("button", name="End").click()
    assert not page.page.locator("#spiral").is_visible()


def test_a_mount_far_away_asks_first(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("control")
    page.page.get_by_role("button", name="Park…").click()
    page.until("it asks", lambda: page.text("#ask-title") == "Park?")
    page.page.click("#ask-no")
    assert not console.truth.goto_running()
