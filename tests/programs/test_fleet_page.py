"""The overview in a real browser, over a real broker: what it shows, and STOP ALL at the mounts' lines."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from pathlib import Path

import axe_playwright_python
import pytest
from PIL import Image
from playwright.sync_api import Page, expect, sync_playwright

from tests.support.process import GATEWAY

from .mosquitto import Broker, Onlooker
from .processes import PATIENCE, Workshop, requires, wait_until
from .test_mosquitto import COMMAND, STATE, gateway

expect.set_options(timeout=PATIENCE * 1000)


@pytest.fixture
def page() -> Iterator[Page]:
    """A page of Chromium; whatever goes wrong in it fails the test."""
    requires("chromium-headless-shell")
    with sync_playwright() as play:
        arguments = ["--no-sandbox"] if os.geteuid() == 0 else []
        browser = play.chromium.launch(executable_path="/usr/bin/chromium-headless-shell", args=arguments)
        tab = browser.new_page()
        tab.add_init_script("localStorage.setItem('light-shown', 'day')")  # else the hour decides how it opens
        wrong: list[str] = []
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        yield tab
        browser.close()
        assert not wrong


def test_fleet_page_shows_all_mounts_and_stop_all_stops_them(workshop: Workshop, page: Page) -> None:
    broker = Broker(workshop)
    onlooker = Onlooker(workshop, broker)
    process, _ = gateway(workshop, url=broker.url)
    onlooker.say("mount-gateway/dome/east/state", '{"online": true, "does": "<b>tracking</b>"}', retain=True)
    onlooker.say("mount-gateway/dome/availability", "online", retain=True)
    fleet = workshop.start([*GATEWAY, "fleet", "--mqtt", broker.url, "--port", "0"], ends_well=True)
    [ready] = fleet.wait_for_lines("ready fleet", 1)
    page.goto(ready.split()[2])
    expect(page.locator("#summary")).to_have_text("2 mounts")
    expect(page.get_by_text("<b>tracking</b>")).to_be_visible()
    onlooker.say(COMMAND, "park")
    expect(page.locator('[data-is="moves"]')).to_have_count(1)
    page.get_by_role("button", name="STOP ALL").click()
    wait_until("it stands", lambda: not onlooker.state(STATE)["moving"])
    expect(page.locator('[data-is="moves"]')).to_have_count(0)
    expect(page.get_by_text("stop: stopped")).to_be_visible()
    assert onlooker.told("mount-gateway/all/command") == [b"stop"]

    page.get_by_role("button", name="Stop east of dome").press("Enter")
    wait_until("one is told", lambda: onlooker.told("mount-gateway/dome/east/command") == [b"stop"])
    onlooker.say("mount-gateway/dome/availability", "offline", retain=True)  # its network is cut
    expect(page.locator("#attention")).to_contain_text("none moves, 1 not there")
    page.get_by_role("button", name="STOP ALL").click()
    expect(page.locator("#attention")).to_contain_text("stop sent, none moves, 1 not there, and not stopped")
    wait_until("the broker has it", lambda: onlooker.told("mount-gateway/all/command") == [b"stop"] * 2)
    page.evaluate((Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text("utf-8"))
    assert page.evaluate("async () => (await axe.run()).violations.map(one => one.id)") == []
    page.get_by_role("button", name="Red light").click()
    wait_until("by night everything is red", lambda: not _not_red(page.screenshot()))

    process.end()
    expect(page.get_by_text("gateway is gone")).to_have_count(2)
    broker.end()
    expect(page.locator("#trouble")).to_contain_text("The broker is not there")
    page.get_by_role("button", name="STOP ALL").click()
    wait_until("it is told", lambda: "cannot be reached" in fleet.output())


def _not_red(png: bytes) -> int:
    """How much green or blue there is at most."""
    bands = Image.open(io.BytesIO(png)).convert("RGB").getextrema()
    return max(int(most) for _, most in bands[1:])
