"""Red by night: not one pixel of any view has more than a trace of green or blue."""

from __future__ import annotations

import socket
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Browser

from .page import DESK, PHONE, VIEWS, Console, Visit, new_page, open_browser


def not_red(picture: Image.Image) -> int:
    """Pixels whose green or blue is above a tenth of their red, or not below 16."""
    seen = np.asarray(picture).astype(int)
    most = seen[..., 1:].max(axis=2)
    return int(((most * 10 > seen[..., 0]) | (most >= 16)).sum())


@pytest.mark.parametrize("size", [PHONE, DESK])
def test_every_page_view_is_red_in_night_mode(
    console: Console, visit: Callable[..., Visit], size: tuple[int, int]
) -> None:
    page = visit(size, light_mode="night", light_shown="night", light_step="4")
    with console.program() as program:
        for view in VIEWS:
            page.show(view)
            if view == "sky":
                page.find("Aldebaran")
            if view == "talk":
                page.listens(program)
                program.say(b":GR#:MS#", 9)
                page.page.focus("#command")
                page.page.keyboard.type(":GR#")
                page.page.keyboard.press("Shift+Home")  # a selection has a colour, too
                page.until("it is shown", lambda: page.page.locator(".exchange").count() > 0)
            picture = page.picture()
            assert not_red(picture) == 0, view
            assert np.asarray(picture)[..., 0].max() > 150, view


def test_dialogs_notices_and_lists_of_the_page_are_red_in_night_mode(visit: Callable[..., Visit]) -> None:
    page = visit(light_mode="night", light_shown="night")
    page.page.fill("#object", "al")
    page.until("names are offered", lambda: page.page.locator("#suggestions li").count() > 1)
    page.page.press("#object", "ArrowDown")
    assert not_red(page.picture()) == 0
    page.find("18:37:00 -70:00:00")
    assert not_red(page.picture()) == 0
    page.page.click("#sync")
    assert page.page.locator("#ask").is_visible() and not_red(page.picture()) == 0
    page.page.click("#ask-no")
    page.page.fill("#object", "Xyzzyx")
    page.page.press("#object", "Enter")
    page.until("it is refused", lambda: "Xyzzyx" in page.text("#notices"))
    assert not_red(page.picture()) == 0
    page.page.click("#tonight-button")
    page.page.click("#tonight-kinds >> text=Mine")
    page.page.click("#tonight summary")
    page.page.locator("#own-file").scroll_into_view_if_needed()
    assert not_red(page.picture()) == 0


def test_page_turns_red_by_itself_while_the_sun_is_low(visit: Callable[..., Visit]) -> None:
    page = visit(light_mode="auto", light_shown="day")  # it is night at the simulated mount
    page.until("it is red", lambda: page.page.evaluate("document.documentElement.dataset.light") == "night")
    page.until("and says why", lambda: page.text("#notices").startswith("Red while the Sun is down"))
    page.page.reload()
    page.until("the page is there again", lambda: page.text("#name").startswith("Celestron"))
    page.page.wait_for_timeout(300)
    assert page.text("#notices") == "", "it is said once"
    page.page.click("#light")
    assert page.page.evaluate("[document.documentElement.dataset.light, localStorage.getItem('light-mode')]") == [
        "day",
        "day",
    ]
    assert not_red(page.picture()) > 100_000


def test_night_view_dims_in_four_steps(visit: Callable[..., Visit]) -> None:
    page = visit(light_mode="night", light_shown="night")
    page.show("more")
    assert not page.page.locator(".keys").is_visible(), "a phone has none"
    page.page.emulate_media(reduced_motion="reduce")
    brightness = []
    for words in ("6", "5", "4", "3"):
        page.page.get_by_role("radio", name=words, exact=True).click()
        page.page.mouse.move(1, 1)
        brightness.append(float(np.asarray(page.picture())[..., 0].mean()))
    assert brightness == sorted(brightness, reverse=True) and brightness[-1] < brightness[0] / 2


def follow(console: Console, page: Visit) -> None:
    page.find("Aldebaran" if console.truth.position().dec > 40.0 else "Capella")
    page.page.tap("#go")


def test_screen_stays_on_while_the_mount_moves(console: Console, visit: Callable[..., Visit]) -> None:
    page = visit(fresh=True)
    page.page.add_init_script(
        "let locks = 0; navigator.wakeLock.request = async () => { window.locks = ++locks; return new EventTarget() }"
    )
    page.page.reload()
    page.until("the page is there again", lambda: page.text("#name").startswith("Celestron"))
    assert page.page.evaluate("window.locks ?? 0") == 0
    follow(console, page)
    page.until("it is asked for", lambda: page.page.evaluate("window.locks") == 1)


def test_screen_stays_on_over_plain_http(console: Console, visit: Callable[..., Visit], browser: Browser) -> None:
    """From another computer, whose browser has no means of its own then; here by this computer's name."""
    visit()  # whose end stops the mount
    name = f"{socket.gethostname().lower()}.local"
    elsewhere = open_browser(browser.browser_type, f"--host-resolver-rules=MAP {name} 127.0.0.1")
    page = Visit(new_page(elsewhere, PHONE), console.url.replace("127.0.0.1", name), PHONE, {"light-mode": "day"})
    assert page.page.evaluate("[isSecureContext, 'wakeLock' in navigator]") == [False, False]
    assert page.page.locator("video").count() == 0
    follow(console, page)
    playing = "(video => video !== null && !video.paused && video.currentTime > 0)(document.querySelector('video'))"
    page.until("it plays", lambda: page.page.evaluate(playing))
    # Of a header that plain http leaves without effect browsers complain.
    page.faults = [one for one in page.faults if "Cross-Origin-Opener-Policy" not in one]
    page.close()
    elsewhere.close()
