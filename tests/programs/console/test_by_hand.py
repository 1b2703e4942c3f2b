"""Motion by hand ends with the finger, the focus, the page and the network; STOP ends everything, by tap and by key."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from ..processes import wait_until
from .page import DESK, Console, Visit

#: What ends a motion by hand besides the release: what the browser tells the page, as a script that tells it so.
LOSSES = {
    "the focus": "window.dispatchEvent(new Event('blur'))",
    "the page": "Object.defineProperty(document, 'hidden', {value: true, configurable: true});"
    "document.dispatchEvent(new Event('visibilitychange'))",
    "the pointer": "document.querySelector('[data-go=north]').dispatchEvent("
    "new PointerEvent('pointercancel', {pointerId: 1, bubbles: true}))",
    "the capture": "document.querySelector('[data-go=north]').releasePointerCapture(1)",
    "the view": "location.hash = '/readings'",
}


@contextmanager
def held(console: Console, page: Visit, direction: str = "north") -> Iterator[None]:
    """A direction is held down, and the mount itself moves."""
    page.show("control")
    box = page.page.locator(f"[data-go={direction}]").bounding_box()
    assert box is not None
    start = console.truth.position()
    page.page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.page.mouse.down()
    page.page.mouse.move(box["x"] + 21, box["y"] + 21)
    page.until("it moves", lambda: console.moved_from(start))
    yield
    console.at_rest()


def test_arrow_moves_the_mount_until_it_is_released_or_lost(console: Console, visit: Callable[..., Visit]) -> None:
    phone, desk = visit(), visit(DESK)
    with held(console, phone):
        phone.until("it says so", lambda: phone.does("Moved by hand"))
        phone.page.mouse.up()
    phone.until("and that it tracks again", lambda: phone.does("Tracking"))
    for loss, script in LOSSES.items():
        page = desk if loss == "the view" else phone  # on a desk the pad is there in every view
        with held(console, page):
            page.page.evaluate(script)
            page.page.mouse.move(5, 5)  # a capture that is lost is told with the next event
        page.page.mouse.up()
        page.page.evaluate("Object.defineProperty(document, 'hidden', {value: false, configurable: true})")


def test_arrow_keys_and_enter_move_the_mount(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("control")
    start = console.truth.position()
    page.page.keyboard.down("ArrowUp")
    page.page.keyboard.up("ArrowUp")
    assert not console.moved_from(start)
    page.page.focus("#pad")
    page.page.keyboard.press("9")
    assert page.text("#rate-shown") == "rate 9, 5.0°/s"
    page.page.keyboard.down("ArrowUp")
    page.until("it moves", lambda: console.moved_from(start))
    page.page.keyboard.up("ArrowUp")
    console.at_rest()
    page.page.keyboard.press("6")  # an earlier test may have left the mount where 5°/s downwards is too fast
    start = console.truth.position()
    page.page.focus("[data-go=south]")
    page.page.keyboard.down("Enter")
    page.until("it moves", lambda: console.moved_from(start))
    page.page.keyboard.up("Enter")
    console.at_rest()


def test_arrows_east_and_west_stand_where_the_chart_shows_east_and_west(visit: Callable[..., Visit]) -> None:
    page = visit(DESK, told={'"equatorial":false': '"equatorial":true'})
    places = "[...document.querySelectorAll('[data-go]')].map(one => [one.dataset.go, one.getBoundingClientRect()])"
    script = f"Object.fromEntries({places}.map(([go, box]) => [go, [box.x, box.y]]))"

    def stands() -> tuple[bool, bool]:
        """Whether east is left of west, and north above south."""
        at = page.page.evaluate(script)
        return at["east"][0] < at["west"][0], at["north"][1] < at["south"][1]

    assert stands() == (True, True) and "E is left" in page.text("#pad-hint")
    page.page.click("#chart-up")
    assert stands() == (False, False) and "W is left" in page.text("#pad-hint"), "south is up in the chart"
    page.page.reload()
    page.until("it is kept", lambda: page.text("#chart-up") == "S ↑")
    page.until("so is the pad", lambda: stands() == (False, False))


def test_arrows_turn_the_tube_of_an_alt_azimuth_mount(visit: Callable[..., Visit]) -> None:
    page = visit(DESK, chart_up="south")
    page.until("so they are named", lambda: page.text("[data-go=east]") == "Left")
    assert page.text("[data-go=north]") == "Up" and "It turns the tube" in page.text("#pad-hint")
    boxes = [page.page.locator(f"[data-go={way}]").bounding_box() for way in ("east", "west")]
    assert boxes[0] and boxes[1] and boxes[0]["x"] < boxes[1]["x"], (
        "and stay where they are, however the chart is turned"
    )


def test_stop_button_and_stop_key_end_a_goto(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    for how in ("tap", "Escape", "Space", "Escape in a field", "Escape in a question", "Enter on STOP"):
        page.show("sky")
        page.find("Aldebaran" if console.truth.position().dec > 40.0 else "Capella")
        page.page.click("#go")
        page.until("it slews", lambda: console.truth.goto_running())
        if how == "tap":
            box = page.page.locator("#stop").bounding_box()
            assert box is not None
            page.page.touchscreen.tap(box["x"] + 50, box["y"] + 20)
        elif how == "Enter on STOP":
            page.page.focus("#stop")
            page.page.keyboard.press("Enter")
        else:
            if how == "Escape in a field":
                page.page.focus("#object")
            if how == "Escape in a question":
                page.show("more")
                page.page.get_by_role("button", name="Narrow the limits…").click()
                page.until("it asks", lambda: page.page.locator("#ask").is_visible())
            page.page.keyboard.press(how.split()[0])
        wait_until(f"the goto has ended by {how}", lambda: not console.truth.goto_running())
        page.until("and not by its arrival", lambda: page.text("#go") == "Go there")
        page.until("it is said", lambda: page.text("#notices").startswith("Stopped."))
        console.at_rest()


def test_space_typed_into_a_field_stops_nothing(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.find("Aldebaran" if console.truth.position().dec > 40.0 else "Capella")
    page.page.click("#go")
    page.until("it slews", lambda: console.truth.goto_running())
    page.page.focus("#object")
    page.page.keyboard.type("m 31")
    assert page.page.input_value("#object").endswith("m 31") and console.truth.goto_running()


def test_release_button_ends_hold_still_and_its_banner(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("control")
    page.page.get_by_role("button", name="Hold still").click()
    page.until("it is shown", lambda: "The mount is held" in page.text("#banners"))
    page.page.hover("[data-go=north]")
    page.page.mouse.down()  # held: an arrow that is let go before the gateway has read it is not refused
    page.until("an arrow is refused", lambda: page.text("#notices p").startswith("The mount is held"))
    page.page.mouse.up()
    page.until("as is told lately", lambda: "Arrow: The mount is held" in page.text("#readings"))
    said = page.text("main")
    assert "mount-gateway stop" not in said, "the page has a button for that"
    page.show("sky")
    page.page.locator("#banners").get_by_role("button", name="Release").click()
    page.until("it is released", lambda: not page.text("#banners").startswith("The mount is held"))


def test_page_offers_only_what_the_mount_can_do(visit: Callable[..., Visit]) -> None:
    """As a telescope that is pushed by hand, and a mount that has no arrows, but gotos."""
    page = visit(told={"never": "told"})
    page.show("control")
    buttons = "[...document.querySelectorAll('#control-pane button')].filter(one => one.checkVisibility())"
    for can, words in (
        (["Sync"], "Hold still, Sync…"),
        (["Goto", "Park"], "Up, Left, Right, Down, −, +, 1′, 5′, Field, Park…, Unpark, Hold still, Spiral search…"),
    ):
        page.hear_of_mount(can=can)
        offered = f"{buttons}.map(one => one.textContent).join(', ')"
        page.until("it is seen", lambda seen=offered, told=words: page.page.evaluate(seen) == told)


@pytest.mark.parametrize(("drive", "name"), [(1.0, "Stars"), (0.9763, "Moon"), (0.9973, "Sun")])
def test_page_shows_the_tracking_rate(visit: Callable[..., Visit], drive: float, name: str) -> None:
    """As an equatorial mount whose motors turn at that part of the stars' speed."""
    page = visit(told={'"equatorial":false': '"equatorial":true', '"drive\\":': f'"drive\\":{drive},\\"told\\":'})
    page.show("control")
    pressed = page.page.locator("[aria-label='Rate of tracking'] [aria-pressed=true]")
    page.until("it is shown", lambda: pressed.count() == 1 and pressed.text_content() == name)
