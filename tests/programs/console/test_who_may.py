"""A page that only looks, until the pin is typed; and a page whose gateway goes and comes again."""

from __future__ import annotations

import re
import signal
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from ..processes import Workshop
from .page import PHONE, Console, Visit, new_page

#: Milliseconds, by the page's own clock, within which it says that a stop was not heard.
TOLD = 1000


@pytest.fixture
def own(workshop: Workshop) -> Console:
    """A gateway of the test's own, whose console has a pin."""
    config = workshop.folder / "gateway.toml"
    config.write_text('[console]\npin = "4711"\n')
    return Console(workshop, str(config))


@pytest.fixture
def page(own: Console, browser: Browser) -> Iterator[Visit]:
    visit = Visit(new_page(browser, PHONE), own.url, PHONE, {"light-mode": "day", "light-shown": "day"})
    yield visit
    visit.close()


def test_page_without_the_pin_can_only_look_and_stop(own: Console, page: Visit) -> None:
    page.until("it is said", lambda: "This page only looks" in page.text("#banners"))
    page.show("control")
    for one in page.page.locator("#orders button, [data-go]").all():
        assert not one.is_enabled()
    page.page.tap("#stop")
    page.until("a stop is carried out", lambda: page.text("#notices") == "Stopped.")
    for pin, answer in (("0000", "This is not the pin."), ("4711", "This page may act now.")):
        page.page.get_by_role("button", name="Enter the pin").first.click()
        page.page.get_by_label("Pin of the console").fill(pin)
        page.page.press("#ask-pin", "Enter")
        page.until(answer, lambda words=answer: page.text("#notices").startswith(words))
    page.until("it may act", lambda: page.page.locator("[data-go=north]").is_enabled())


def test_pending_stop_survives_a_page_reload(own: Console, page: Visit) -> None:
    page.page.evaluate("sessionStorage.setItem('stop-owed', String(Date.now() - 20000))")
    page.page.reload()
    page.until("it is sent", lambda: re.fullmatch(r"STOP arrived 2\d s late: stopped\.", page.text("#notices")))
    page.page.evaluate("sessionStorage.setItem('stop-owed', String(Date.now() - 40000))")
    page.page.reload()
    page.until("a stop of long ago is not sent, and that is said", lambda: "WAS NOT SENT" in page.text("#notices"))
    page.page.reload()
    page.until("the page is there again", lambda: page.text("#name").startswith("Celestron"))
    page.page.wait_for_timeout(300)
    assert page.text("#notices") == "", "which is said once"


def test_page_warns_of_a_gateway_that_does_not_respond(own: Console, page: Visit) -> None:
    """A stop that it has not heard is said aloud, and is sent when it is there again."""
    page.page.clock.install()
    page.page.clock.pause_at(page.page.evaluate("Date.now() + 100"))
    own.gateway.signal(signal.SIGSTOP)
    try:
        page.page.tap("#stop")
        page.page.clock.run_for(TOLD)
        page.until("a stop that nobody heard is said", lambda: "DID NOT REACH THE GATEWAY" in page.text("#notices"))
        page.page.clock.resume()
        page.until("it is said", lambda: page.does("No connection"))
        page.until("so is for how long", lambda: "No connection to the gateway for" in page.text("#banners"))
    finally:
        own.gateway.signal(signal.SIGCONT)
    page.until("it is connected again, and has stopped", lambda: page.text("#notices").endswith("s late: stopped."))
    assert not page.text("#banners").startswith("No connection") and not page.does("No connection")


def test_page_repeats_a_stop_and_then_reports_its_failure(own: Console, page: Visit) -> None:
    page.page.clock.install()
    own.gateway.signal(signal.SIGSTOP)
    try:
        page.page.evaluate(
            "() => { window.tries = 0; window.real = fetch; "
            "window.fetch = () => { tries += 1; return Promise.reject(new Error()) } }"
        )
        page.page.clock.run_for(20_000)
        page.until("it is lost", lambda: page.does("No connection"))
        seldom = page.page.evaluate("tries")
        page.page.tap("#stop")
        page.page.clock.run_for(5_000)
        assert page.page.evaluate("tries") - seldom > 12, "the next attempt does not wait for three seconds"
        page.page.clock.run_for(22_000)
        assert page.text("#stop-says") == "not sent yet" and "is sent again if" in page.text("#notices")
        page.page.clock.run_for(4_000)
        assert page.text("#stop-says") == "NOT sent: press again" and "WAS NOT SENT" in page.text("#notices")
        page.page.evaluate("() => { window.fetch = real }")
    finally:
        own.gateway.signal(signal.SIGCONT)
    page.page.clock.run_for(3_000)
    page.until("it is connected again", lambda: not page.does("No connection"))
    assert "WAS NOT SENT" in page.text("#notices") and page.text("#stop-says") == "NOT sent: press again"
    page.page.tap("#stop")
    page.until("it is stopped", lambda: page.text("#notices") == "Stopped." and page.text("#stop-says") == "all motion")


def test_page_reports_a_lost_network_at_once(own: Console, page: Visit) -> None:
    page.page.evaluate("dispatchEvent(new Event('offline'))")
    page.page.wait_for_timeout(800)
    assert not page.does("No connection"), "a gateway on the same computer is still there"
    own.gateway.signal(signal.SIGSTOP)
    try:
        took = page.page.evaluate("""new Promise((resolve) => {
          const began = performance.now();
          new MutationObserver(() => document.body.dataset.mount === "lost" && resolve(performance.now() - began))
            .observe(document.body, { attributes: true });
          dispatchEvent(new Event("offline"));
        })""")
        assert took < 2500, f"{took:.0f} ms"
    finally:
        own.gateway.signal(signal.SIGCONT)
    page.until("it is connected again", lambda: not page.does("No connection"))
