"""A web page moves no telescope: Chromium on hostile pages, and at the ports' own addresses.

One page posts commands with `fetch`, one submits them as a form, and one is the surface's own address. Judged at the
simulated mount's line, where nothing but the gateway's own questions may pass.
"""

from __future__ import annotations

import re
import socket
import time
from functools import partial
from typing import NamedTuple

from .browser import Browser, Site
from .hand_control import HandControl
from .meade import Meade
from .processes import PATIENCE, Process, Workshop, requires, wait_until
from .product import OF_ANOTHER_NIGHT, PRODUCT, endpoints, start_meade, start_simulator
from .sky import NORTH
from .tap import Tap

ATTACK = "#:Sr04:00:00#:Sd+40*00:00#:MS#"
#: What only asks: of a hand control, and of a Meade.
QUESTIONS = {
    "nexstar": re.compile(rb"([EeZzVvJLmtwhipl]|K.|P\x01.{6})+", re.DOTALL),
    "lx200": re.compile(rb"(\x06|:G[^#]*#|:D#|:h\?#)+"),
}
FETCH = """<script>
Promise.allSettled([%s].map(port => fetch('http://127.0.0.1:' + port + '/', {method: 'POST', mode: 'no-cors',
  headers: {'Content-Type': 'text/plain'}, body: '%s'}))).then(() => fetch('/done'));
</script>"""
FORM = """<form action="http://127.0.0.1:%d/x" method="post" enctype="text/plain"><input name="%s" value="x"></form>
<script>document.forms[0].submit()</script>"""
SURFACES = ("lx200", "nexstar")


class Setup(NamedTuple):
    """A mount with the tap on its line, and the gateway's port for each surface."""

    mount: str
    truth: HandControl | Meade
    tap: Tap
    gateway: Process
    ports: dict[str, int]

    def has_seen(self, strangers: int) -> bool:
        """Whether so many have been turned away, by what its log says."""
        return self.gateway.output().count("sends an HTTP request; this is a port for") >= strangers


def set_up(workshop: Workshop, mount: str) -> Setup:
    wire, truth = (
        start_simulator(workshop, "nexstar:cpc", NORTH)
        if mount == "nexstar"
        else start_meade(workshop, "lx200gps", NORTH)
    )
    tap = Tap(workshop, wire.port)
    argv = [
        *PRODUCT,
        "run",
        "--no-console",
        "--mount",
        f"{mount}@socket://127.0.0.1:{tap.port}",
        *OF_ANOTHER_NIGHT,
        "--hibernate",
        "--log",
    ]
    for surface in SURFACES:
        argv += ["--surface", f"{surface}@tcp://127.0.0.1:0"]
    gateway = workshop.start(argv, ends_well=True)
    ready = gateway.wait_for_lines("ready ", len(SURFACES))
    return Setup(mount, truth, tap, gateway, dict(zip(SURFACES, (end.port for end in endpoints(ready)), strict=True)))


class Program:
    """A program that was here before the browser, on one surface."""

    def __init__(self, workshop: Workshop, surface: str, port: int) -> None:
        self._question, self._length = (b":GR#", 9) if surface == "lx200" else (b"e", 18)
        self._link = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)
        workshop.keep(self._link.close)

    def ask(self) -> float:
        """Ask for the position -> milliseconds to the end of the answer."""
        began, answer = time.perf_counter(), b""
        self._link.sendall(self._question)
        while len(answer) < self._length:
            piece = self._link.recv(64)
            assert piece, "the connection was closed"
            answer += piece
        assert answer.endswith(b"#")
        return (time.perf_counter() - began) * 1000.0


def reads(browser: Browser, tab: str, page: tuple[str, str]) -> bool:
    """Whether a tab shows a page: its address and title."""
    return browser.shows(tab) == page


def test_hostile_web_pages_and_browser_visits_move_no_mount(workshop: Workshop) -> None:
    requires("chromium-headless-shell")
    setups = [set_up(workshop, mount) for mount in ("nexstar", "lx200")]
    programs = {
        (setup.mount, surface): Program(workshop, surface, port)
        for setup in setups
        for surface, port in setup.ports.items()
    }
    ports = [port for setup in setups for port in setup.ports.values()]
    pages = {"/fetch": FETCH % (",".join(map(str, ports)), ATTACK)}
    pages |= {f"/form{port}": FORM % (port, ATTACK) for port in ports}
    site, browser = Site(workshop, pages), Browser(workshop)
    for program in programs.values():
        program.ask()
    before = {setup.mount: len(setup.tap.heard) for setup in setups}

    def unharmed(what: str, strangers: int) -> None:
        for setup in setups:
            wait_until(f"{what} has come", partial(setup.has_seen, strangers * len(SURFACES)))
            for piece in setup.tap.heard[before[setup.mount] :]:
                assert QUESTIONS[setup.mount].fullmatch(piece), (what, setup.mount, piece)
            assert not setup.truth.goto_running(), (what, setup.mount)
        for (mount, surface), program in programs.items():
            print(f"{what}: {surface} on {mount} answers after {program.ask():.1f} ms")

    browser.visit(f"{site.url}/fetch")
    wait_until("the page has posted", lambda: "/done" in site.asked)
    unharmed("fetch", 1)
    shown = (f"http://127.0.0.1:{port}/x" for port in (*ports, *ports))
    for address in [*(f"{site.url}/form{port}" for port in ports), *(f"http://127.0.0.1:{port}/x" for port in ports)]:
        tab, at = browser.visit(address), next(shown)
        page = at, at.removeprefix("http://")
        wait_until(f"{address} is answered with a page", partial(reads, browser, tab, page))
    time.sleep(0.5)  # what would have been begun can be seen by now
    unharmed("form and visit", 3)
