"""Steps with the arrows, and a search in a spiral: one goto a tap, which ends by itself."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from ..sky import Spot, separation
from .page import Console, Visit

#: The telescope and eyepiece that this browser keeps.
HALF_A_DEGREE = '{"telescope": 2000, "eyepiece": 20, "apparent": 50}'


def is_away(console: Console, start: Spot, minutes: float) -> bool:
    """Whether the mount itself points so far from where it pointed, to 1.5 minutes of arc."""
    return abs(separation(console.truth.position(), start) * 60.0 - minutes) < 1.5


def offsets(now: Spot, before: Spot) -> tuple[float, float]:
    """How far the mount itself has gone north and east, in seconds of arc."""
    along = (now.ra - before.ra + 180.0) % 360.0 - 180.0
    return (now.dec - before.dec) * 3600.0, along * math.cos(math.radians(now.dec)) * 3600.0


def test_tap_on_a_step_arrow_moves_the_mount_by_one_step(console: Console, visit: Callable[..., Visit]) -> None:
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


def test_guide_pulse_moves_in_the_direction_named_on_its_arrow(console: Console, visit: Callable[..., Visit]) -> None:
    """By the sky, also on an alt-azimuth mount, whose other arrows turn the tube; as fast as is chosen."""
    page = visit()
    page.show("more")
    for rate in ("½ ×", "1 ×"):
        chosen = page.page.get_by_role("button", name=rate, exact=True)
        chosen.click()
        page.until("it is shown", lambda one=chosen: one.get_attribute("aria-pressed") == "true")
    page.show("control")
    with (
        console.program() as program
    ):  # near the zenith, where a test may have left it, the azimuth is too slow for that
        assert program.say(b":Sr04:37:22#:Sd+16*33:36#:MS#", 3) == b"110"
    page.until("it is there", lambda: separation(console.truth.position(), Spot(69.34, 16.56)) < 0.5)
    console.at_rest()
    page.until("it tracks", lambda: page.does("Tracking"))
    assert page.text("[data-go=north]") == "Up"
    page.page.get_by_role("radio", name="Pulse").click()
    assert [page.text(f"[data-go={way}]") for way in ("north", "south", "east", "west")] == ["N", "S", "E", "W"]
    assert "E is left, as in the chart." in page.text("#pad-hint")
    before = console.truth.position()
    for arrow, wanted in (("north", (15.0, 0.0)), ("east", (15.0, 15.0))):  # seconds of arc, at the stars' speed
        page.page.click(f"[data-go={arrow}]")
        page.until(
            "it has gone that way",
            lambda way=wanted: offsets(console.truth.position(), before) == pytest.approx(way, abs=3.0),
        )
        page.until("it is told", lambda way=arrow: page.text("#notices") == f"It was guided {way} for 1000 ms.")


def test_spiral_search_advances_one_place_with_each_tap(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit(optics=HALF_A_DEGREE)
    page.show("control")
    console.at_rest()
    start = console.truth.position()
    page.page.get_by_role("button", name="Spiral search…").click()
    for number, minutes in ((2, 30.0), (3, 42.4)):
        page.until("the next is offered", lambda place=number: page.text("#spiral-next") == f"Place {place}")
        page.until("it is there", lambda way=minutes: is_away(console, start, way))
        page.until("it tracks", lambda: page.does("Tracking"))
        console.at_rest()  # what the page shows is a moment old
        if number == 2:
            page.page.click("#spiral-next")
    page.page.get_by_role("button", name="Back").click()
    page.until("it is back", lambda: separation(console.truth.position(), start) * 60 < 1)
    page.page.get_by_role("button", name="End").click()
    assert not page.page.locator("#spiral").is_visible()


def test_page_asks_before_parking_a_mount(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("control")
    page.page.get_by_role("button", name="Park…").click()
    page.until("it asks", lambda: page.text("#ask-title") == "Park?")
    page.page.click("#ask-no")
    assert not console.truth.goto_running()
