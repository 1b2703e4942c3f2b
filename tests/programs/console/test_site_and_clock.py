"""Settings from the page: this device's clock in one tap, a pasted place, narrower limits; what is none is refused."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from .page import DESK, PHONE, Visit


def test_page_sets_the_clock_from_this_device_in_one_tap(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("readings")
    page.page.locator("#readings").get_by_role("button", name="Use this device's time").click()
    page.until("it is answered in words", lambda: page.text("#notices") != "")


@pytest.mark.parametrize("size", [PHONE, (320, 568), (844, 390), DESK])
def test_page_accepts_a_pasted_place(visit: Callable[..., Visit], size: tuple[int, int]) -> None:
    page = visit(size)
    page.show("readings")
    for site, answer in (("north, 10", "That is no place on Earth"), ("45,001° N; 10.001 E", "The site is set")):
        page.page.get_by_role("button", name="Set the site…").click()
        page.page.fill("#ask-site", site)
        page.page.press("#ask-site", "Enter")
        page.until("it is answered in words", lambda words=answer: page.text("#notices").startswith(words))
    assert "site = [45.001, 10.001]" in page.text("#notices"), "what to write into gateway.toml"
    assert "holds for nobody" in page.text("#notices")
    cut = "[...document.querySelectorAll('.notice, .notice p')].some(one => one.scrollHeight > one.clientHeight)"
    assert not page.page.evaluate(cut)
    page.page.locator("#notices").get_by_role("button", name="Close").click()
    assert page.text("#notices") == "", "it stays until it is closed"


def test_page_does_not_wait_for_a_device_that_looks_for_its_place(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.page.evaluate(
        "navigator.geolocation.getCurrentPosition = told => { window.tell = () => told({coords: "
        "{latitude: 48.1, longitude: 11.6}}) }"
    )
    page.show("readings")
    for typed, stands in (("", "48.1000, 11.6000"), ("45.5, 10.5", "45.5, 10.5")):
        page.page.get_by_role("button", name="Set the site…").click()
        page.until("it asks at once", lambda: page.page.locator("#ask-site").is_visible())
        if typed:
            page.page.fill("#ask-site", typed)
        page.page.evaluate("tell()")
        page.until("its place", lambda where=stands: page.page.input_value("#ask-site") == where)
        page.page.click("#ask-no")


def test_page_narrows_limits_and_restores_them(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("more")

    def narrow(name: str, value: str) -> str:
        page.page.get_by_role("button", name="Narrow the limits…").click()
        assert not page.page.locator("#ask-hour_angle").count(), "an alt-azimuth mount has no such limit"
        page.page.fill(f"#ask-{name}", value)
        page.page.evaluate("document.getElementById('notices').replaceChildren()")
        page.page.press(f"#ask-{name}", "Enter")
        page.until("it is answered", lambda: page.text("#notices") != "")
        return page.text("#notices")

    assert "lowest = 5, highest = 90, sun = 0" in narrow("lowest", "5"), "wider ones are written down"
    assert narrow("sun", "far").startswith("Write numbers")
    assert "no nearer to the Sun than 30°" in narrow("sun", "30")
    page.until(
        "it says how to keep them", lambda: "gateway.toml: lowest = 10, highest = 90, sun = 30" in page.text("#more")
    )
    page.page.get_by_role("button", name="As configured").click()
    page.until("they are as before", lambda: "To keep these" not in page.text("#more"))
