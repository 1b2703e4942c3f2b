"""The clock of this device and a typed place go to the mount, if somebody agrees; a place that is none is refused."""

from __future__ import annotations

from collections.abc import Callable

from .page import Console, Visit


def test_this_devices_time(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("readings")
    before, _ = console.truth.clock()
    page.page.get_by_role("button", name="Use this device's time…").click()
    assert page.text("#ask-title") == "Use this device's time?"
    page.page.click("#ask-no")
    page.page.wait_for_timeout(200)
    now, _ = console.truth.clock()
    assert (now - before).total_seconds() < 60
    page.page.get_by_role("button", name="Use this device's time…").click()
    page.page.click("#ask-yes")
    page.until("it is answered in words", lambda: page.text("#notices") != "")


def test_a_typed_place(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit()
    page.show("readings")
    for latitude, longitude, answer in (("north", "10", "That is no place on Earth"), ("45,001", "10.001", "")):
        page.page.get_by_role("button", name="Set the site…").click()
        page.page.get_by_label("Latitude").fill(latitude)
        page.page.get_by_label("Longitude").fill(longitude)
        page.page.press("#ask-longitude", "Enter")
        page.until("it is answered in words", lambda words=answer: page.text("#notices").startswith(words or "The"))
