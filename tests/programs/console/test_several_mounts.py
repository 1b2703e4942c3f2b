"""Two mounts in one gateway: the page shows one of them, moves that one alone, and stops both."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

from ..processes import Workshop, workshop_in
from ..product import PRODUCT, start_meade, start_simulator
from ..sky import NORTH, SOUTH, separation
from .page import DESK, PHONE, Visit, new_page

CONFIG = """
[[mount]]
name = "west"
at = "nexstar@socket://127.0.0.1:{west}"
sun = 0.0
computer-clock = "doubtful"
state = "{state}/west"

[[mount]]
name = "east"
at = "lx200@socket://127.0.0.1:{east}"
sun = 0.0
computer-clock = "doubtful"
state = "{state}/east"

[[surface]]
mount = "west"
at = "lx200@tcp://127.0.0.1:0"

[[surface]]
mount = "east"
at = "nexstar@tcp://127.0.0.1:0"

[console]
at = "tcp://127.0.0.1:0"
"""


#: Keeps what the page asks for of what nobody polls.
SAID = """() => {
  const send = WebSocket.prototype.send;
  window.said = [];
  WebSocket.prototype.send = function (text) {
    said.push(...[JSON.parse(text)].filter(one => one.do === 'look'));
    return send.call(this, text);
  };
}"""


class Two:
    """A Celestron in the north and a Meade in the south; the truth of each is read past the gateway."""

    def __init__(self, workshop: Workshop) -> None:
        west, self.west = start_simulator(workshop, "nexstar:cpc", NORTH, speed=4.0)
        east, self.east = start_meade(workshop, "lx200gps", SOUTH, speed=4.0)
        config = workshop.folder / "gateway.toml"
        config.write_text(CONFIG.format(west=west.port, east=east.port, state=workshop.folder))
        gateway = workshop.start([*PRODUCT, "run", str(config)], ends_well=True)
        self.url = gateway.wait_for_lines("ready console ", 1)[0].split()[-1]


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Two]:
    with workshop_in(tmp_path_factory.mktemp("two")) as shop:
        yield Two(shop)


@pytest.mark.parametrize("size", [(844, 390), PHONE, (1024, 768), (320, 568)])
def test_page_with_two_long_mount_names_overlaps_nothing(two: Two, browser: Browser, size: tuple[int, int]) -> None:
    told = {'"west"': '"Observatory west"', '"east"': '"Observatory east"'}
    new = new_page(browser, size)
    page = Visit(new, two.url, size, {"light-mode": "day"}, "Observatory west: Celestron", told=told)
    one_cut = "[...document.querySelectorAll('#mounts button')].some(one => one.scrollWidth > one.clientWidth)"
    for view in ("sky", "control"):
        page.show(view)
        assert page.overlapping() == [], view
        assert not page.page.evaluate(one_cut), view
    page.close()


@pytest.mark.parametrize("size", [PHONE, (844, 390), DESK])
def test_page_moves_the_chosen_mount_and_stops_both(two: Two, browser: Browser, size: tuple[int, int]) -> None:
    page = Visit(new_page(browser, size), two.url, size, {"light-mode": "day", "rate": "7"}, "west: Celestron")
    north = page.text("#readings")
    page.page.evaluate(SAID)
    page.page.get_by_role("radio", name="east").click()
    page.until("the side of its pier is asked for", lambda: page.page.evaluate("said.some(one => one.mount === 1)"))
    page.until("the other one is shown", lambda: page.text("#name").startswith("east: Meade LX"))
    page.until("with its own readings", lambda: page.text("#readings") != north)
    assert f"{-SOUTH.latitude:.1f} S" in page.text("#readings")

    west, east = two.west.position(), two.east.position()
    page.show("control")
    box = page.page.locator("[data-go=north]").bounding_box()
    assert box is not None
    page.page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.page.mouse.down()
    page.until("the chosen one moves", lambda: separation(two.east.position(), east) > 0.05)
    assert separation(two.west.position(), west) < 0.05, "the other one has moved"
    assert page.text("#stop-says") == "all mounts"
    page.page.keyboard.press("Escape")
    page.until("it is stopped", lambda: not page.does("Moved by hand"))
    page.page.mouse.up()

    page.show("sky")
    page.find("Sirius")
    page.page.click("#go")
    page.until("it slews", lambda: page.does("Slewing"))
    page.page.get_by_role("radio", name="west").click()
    page.until("the first one is shown again", lambda: page.text("#name").startswith("west: Celestron"))
    page.until("what the other does is not said of this one", lambda: page.does("Tracking"))
    page.page.click("#stop")
    page.page.get_by_role("radio", name="east").click()
    page.until("the one that was not looked at is stopped", lambda: page.does("Tracking"))
    assert separation(two.west.position(), west) < 0.05
    wide = page.page.evaluate("document.documentElement.scrollWidth > innerWidth")
    page.close()
    assert not wide
