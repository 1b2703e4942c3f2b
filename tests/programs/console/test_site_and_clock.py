"""The clock of this device goes to the mount with one tap, and so does a pasted place; one that is none is refused."""

from __future__ import annotations

from collections.abc import Callable

from .page import Visit


def test_this_devices_time_in_one_tap(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("readings")
    page.page.locator("#readings").get_by_role("button", name="Use this device's time").click()
    page.until("it is answered in words", lambda: page.text("#notices") != "")


def test_a_place_that_is_pasted(visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("readings")
    for site, answer in (("north, 10", "That is no place on Earth"), ("45,001° N; 10.001 E", "The site is set")):
        page.page.get_by_role("button", name="Set the site…").click()
        page.page.fill("#ask-site", site)
        page.page.press("#ask-site", "Enter")
        page.until("it is answered in words", lambda words=answer: page.text("#notices").startswith(words))
    assert "site = [45.001, 10.001]" in page.text("#notices"), "what to write into gateway.toml"
