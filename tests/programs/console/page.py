"""The console as a person has it: a simulated mount, the gateway with its page, and Chromium that looks at the page.

Everything that a browser complains of, and every address that it asks for, is kept: a test that is over has none but
the console's own, and no complaint.
"""

from __future__ import annotations

import contextlib
import datetime
import io
import json
import os
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, BrowserType, Page, WebSocketRoute

from gateway.astro.ephemeris.almanac import DAY
from gateway.astro.ephemeris.keeper import renew_almanac

from ..processes import PATIENCE, Process, Workshop, requires, wait_until
from ..product import PRODUCT, endpoints, start_simulator
from ..sky import NIGHT, NORTH, Spot, separation

PHONE, TABLET, DESK = (390, 844), (820, 1180), (1440, 900)
VIEWS = ("sky", "control", "readings", "talk", "more")
_WARDED = ("--no-sandbox", "--disable-dev-shm-usage", "--disable-background-networking", "--disable-component-update")


#: Pairs of what one reads or presses that overlap, as far as they are not scrolled out of sight.
OVERLAPPING = """() => {
  const those = document.querySelectorAll("#does, #name, .banner p, .asks, button, input, .views a");
  const seen = [...those].flatMap((one) => {
    const { left, top, right, bottom } = one.getBoundingClientRect();
    const around = ["main", ".pane", ".under"].map((name) => one.closest(name)).filter(Boolean);
    const low = Math.min(bottom, ...around.map((other) => other.getBoundingClientRect().bottom));
    return one.checkVisibility() && right - left > 1 && top < low ? [{ one, left, top, right, low }] : [];
  });
  const meet = (a, b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.low - 1 && b.top < a.low - 1;
  return seen.flatMap((a, index) => seen.slice(index + 1).filter((b) => meet(a, b))
    .map((b) => `${a.one.id || a.one.textContent} × ${b.one.id || b.one.textContent}`));
}"""

#: A file of the console at which a browser does nothing.
EMPTY = "app.webmanifest"
#: Forget earlier visits but for what is given.
FORGET = """kept => {
  sessionStorage.clear();
  localStorage.clear();
  for (const [name, value] of Object.entries(kept)) localStorage.setItem(name, value);
}"""

#: For ``Visit``: of what the mount does after it was opened, the page hears only what ``hear_of_mount`` tells it.
UNHEARD: Mapping[str, str] = {"unheard": "unheard"}
#: What the gateway tells of where a mount is that points at Aldebaran.
AT_ALDEBARAN: Mapping[str, float] = {
    "ra": 69.34, "dec": 16.56, "ra2000": 68.98, "dec2000": 16.51, "alt": 50.0, "az": 180.0, "age": 0.0
}  # fmt: skip
#: Seconds for which the mount must rest to be at rest; degrees a second that are less than any motion by hand.
RESTS, TRACKS = 0.3, 0.008


class Console:
    """The gateway's processes, and the truth about the mount read past it."""

    def __init__(self, workshop: Workshop, *more: str, moment: datetime.datetime = NIGHT) -> None:
        requires("chromium-headless-shell")
        day = int(moment.timestamp() // DAY)
        renew_almanac([day, day + 1])  # for the planets of the night
        mount, self.truth = start_simulator(workshop, "nexstar:cpc", NORTH, speed=4.0, moment=moment)
        argv = [*PRODUCT, "run", "--mount", f"nexstar@socket://127.0.0.1:{mount.port}", "--sun", "0", "--lowest", "10"]
        argv += ["--computer-clock", "doubtful"]  # the night is the mount's, at whatever hour this runs
        argv += ["--surface", "lx200@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0"]
        argv += ["--state", str(workshop.folder / "state"), *more]
        self.gateway: Process = workshop.start(argv, ends_well=True)
        self.url = self.gateway.wait_for_lines("ready console ", 1)[0].split()[-1]
        [surface] = endpoints([line for line in self.gateway.whole_lines("ready ") if "@" in line])
        self.port = surface.port

    def moved_from(self, place: Spot) -> bool:
        """Whether the mount itself points elsewhere, by more than its tracking makes in a second."""
        return separation(self.truth.position(), place) > 0.02

    def at_rest(self) -> None:
        """Wait until the mount itself goes no faster than tracking does, however slow the looks are."""
        looks: list[tuple[float, Spot]] = []

        def still() -> bool:
            looks.append((time.monotonic(), self.truth.position()))
            now, here = looks[-1]
            then, there = next((look for look in reversed(looks) if now - look[0] >= RESTS), looks[-1])
            return now > then and separation(here, there) < TRACKS * (now - then)

        wait_until("the mount rests", still)

    @contextlib.contextmanager
    def program(self) -> Iterator[Program]:
        """Another program that is connected."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=PATIENCE) as link:
            yield Program(link)


class Program:
    """A program of the LX200 protocol."""

    def __init__(self, link: socket.socket) -> None:
        self._link = link
        self.name = "{}:{}".format(*link.getsockname())

    def say(self, data: bytes, answer: int = 0) -> bytes:
        """Send bytes; so many of the answer."""
        self._link.sendall(data)
        found = b""
        while len(found) < answer:
            part = self._link.recv(answer - len(found))
            assert part, "the connection was closed"
            found += part
        return found


class Visit:
    """The console in a page of a browser; ``faults`` and ``asked`` are what the page complains of and asks for."""

    def __init__(
        self,
        page: Page,
        url: str,
        size: tuple[int, int],
        kept: Mapping[str, str],
        shows: str = "Celestron",
        told: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """``kept``: what this browser remembers of earlier visits. ``told``: what the gateway tells, as JSON, and what
        the page hears instead."""
        width, height = size
        self.page = page
        page.set_viewport_size({"width": width, "height": height})
        page.emulate_media(reduced_motion="null", forced_colors="null")
        if not page.url.startswith(url):
            page.goto(f"{url}{EMPTY}")  # the storage is that of the console's address
        page.evaluate(FORGET, dict(kept))
        self.faults: list[str] = []
        self.asked: list[str] = []
        self._heard: dict[Any, Callable[[Any], None]] = {
            "console": self._complained,
            "pageerror": lambda error: self.faults.append(str(error)),
            "dialog": lambda dialog: self.faults.append(f"dialog: {dialog.message}"),
            "request": lambda request: self.asked.append(request.url),
        }
        for event, hear in self._heard.items():
            page.on(event, hear)
        self.url, self._told = url, told
        self._send: Callable[[str], None] = lambda message: None
        #: The last message of the mounts, and what the page hears of the first one instead.
        self._mounts: dict[str, Any] = {}
        self._instead: dict[str, object] = {}
        if told:
            page.route_web_socket("**/socket*", self._tell_otherwise)
        page.goto(url)
        self.until("the page shows the mount", lambda: self.text("#name").startswith(shows))

    def _complained(self, message: Any) -> None:
        no_icon = message.location["url"].endswith("/favicon.ico")  # asked for beside EMPTY, which names none
        if message.type in ("error", "warning") and not no_icon:
            self.faults.append(f"{message.text} {message.location}")

    def _tell_otherwise(self, route: WebSocketRoute) -> None:
        def hear(message: str | bytes) -> None:
            assert isinstance(message, str)
            for told, heard in self._told.items():
                message = message.replace(told, heard)
            if not message.startswith('{"mounts"'):
                route.send(message)
            elif self._told is not UNHEARD or not self._mounts:
                self._mounts = json.loads(message)
                self.hear_of_mount()

        route.connect_to_server().on_message(hear)
        self._send = route.send

    def hear_of_mount(self, **state: object) -> None:
        """Tell the page this of the first mount from now on; for a visit with ``told``."""
        self._instead |= state
        self._mounts["mounts"][0] |= self._instead
        self._send(json.dumps(self._mounts))

    def text(self, selector: str) -> str:
        """What an element says."""
        return (self.page.locator(selector).first.text_content() or "").strip()

    def until(self, what: str, happened: Any) -> None:
        """Look again until it is so; the page goes on meanwhile."""

        def look() -> bool:
            self.page.wait_for_timeout(60)  # what the browser reports is heard while it is waited here
            return bool(happened())

        wait_until(what, look)

    def sizes(self, *sizes: tuple[int, int]) -> Iterator[tuple[int, int]]:
        """The screen in one size after the other."""
        for width, height in sizes:
            self.page.set_viewport_size({"width": width, "height": height})
            yield width, height

    def show(self, view: str) -> None:
        """Another view, by its address."""
        self.page.evaluate("view => { location.hash = `/${view}` }", view)
        self.until(f"{view} is shown", lambda: self.page.evaluate("document.body.dataset.view") == view)

    def find(self, name: str) -> None:
        """Type a name and press Enter; its card is there then."""
        self.page.fill("#object", name)
        self.page.press("#object", "Enter")
        self.until(f"the card of {name}", lambda: self.page.locator("#place h3").is_visible())

    def listens(self, program: Program) -> None:
        """Wait until what programs say is told to the page, which asks for it when it shows the conversation."""
        told = self.page.locator(".exchange", has_text=":GC#")
        self.until("it is told", lambda: program.say(b":GC#", 9) and told.count() > 0)

    def overlapping(self) -> list[str]:
        """Pairs of what one reads or presses that overlap now."""
        found: list[str] = self.page.evaluate(OVERLAPPING)
        return found

    def does(self, words: str) -> bool:
        """Whether the first line of the page says this."""
        return self.text("#does") == words

    def picture(self) -> Image.Image:
        """What is seen now."""
        return Image.open(io.BytesIO(self.page.screenshot())).convert("RGB")

    def leave(self) -> None:
        """Leave the console to an address of its own that shows nothing: from there the next visit costs a third."""
        for event, hear in self._heard.items():
            self.page.remove_listener(event, hear)
        self.page.goto(f"{self.url}{EMPTY}")
        self._check()

    def close(self) -> None:
        """Close the page and its browser's memory."""
        self.page.context.close()
        self._check()

    def _check(self) -> None:
        """Nothing may have been complained of, and nothing asked for but of the console."""
        foreign = [url for url in self.asked if not url.startswith((self.url, self.url.replace("http:", "ws:")))]
        assert not foreign, foreign
        assert not self.faults, self.faults


def has_touch(size: tuple[int, int]) -> bool:
    """Whether a screen of this size is taken for a touch screen."""
    return size[0] < 1000


def new_page(browser: Browser, size: tuple[int, int]) -> Page:
    """Return a page in a browser that remembers nothing."""
    context = browser.new_context(has_touch=has_touch(size), accept_downloads=True)
    context.set_default_timeout(PATIENCE * 1000)
    return context.new_page()


def open_browser(chromium: BrowserType, *more: str) -> Browser:
    """Debian's Chromium without a window."""
    args = [*(_WARDED if os.geteuid() == 0 else _WARDED[1:]), *more]
    return chromium.launch(executable_path="/usr/bin/chromium-headless-shell", args=args)
