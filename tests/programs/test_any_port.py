"""Real programs of every protocol on one port: Hamlib, INDI's drivers, Chromium; and all at once.

Stellarium is in ``test_stellarium``.
"""

from __future__ import annotations

from . import scenario
from .browser import Browser, Site
from .hamlib import CELESTRON, Rotator, terminal_to
from .hand_control import HandControl
from .meade import Meade
from .processes import Workshop, requires, wait_until
from .product import Endpoint, start_any_gateway, start_meade, start_simulator
from .sky import NORTH, Spot, arcseconds
from .tap import Tap
from .telescope import Telescope
from .test_browser import ATTACK, FETCH, FORM, QUESTIONS
from .test_hamlib import turns_and_stops
from .test_stellarium import STAR, told

LX200, NEXSTAR = ("indi_lx200autostar", "LX200 Autostar"), ("indi_celestron_gps", "Celestron GPS")


def start(workshop: Workshop, mount: str) -> tuple[Endpoint, HandControl | Meade]:
    """The port, and the mount behind it."""
    if mount == "nexstar":
        wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=4.0)
        return start_any_gateway(workshop, wire, mount), truth
    meade, seen = start_meade(workshop, "lx200gps", NORTH, speed=4.0)
    return start_any_gateway(workshop, meade, mount), seen


def test_auto_detecting_port_serves_hamlib(workshop: Workshop) -> None:
    """It opens terminals only; the connection behind this one is opened before Hamlib says anything."""
    requires("rotctld", "socat")
    surface, truth = start(workshop, "lx200")
    turns_and_stops(Rotator(workshop, CELESTRON, terminal_to(workshop, surface.port)), truth)


def test_hostile_web_page_moves_no_mount_over_port_any(workshop: Workshop) -> None:
    """What it posts begins as HTTP does, so that all of it is HTTP's, and the console refuses it."""
    requires("chromium-headless-shell")
    wire, truth = start_simulator(workshop, "nexstar:cpc", NORTH)
    tap = Tap(workshop, wire.port)
    surface = start_any_gateway(workshop, Endpoint(wire.speaks, f"tcp://127.0.0.1:{tap.port}"), "nexstar")
    pages = {"/fetch": FETCH % (surface.port, ATTACK), "/form": FORM % (surface.port, ATTACK)}
    site, browser = Site(workshop, pages), Browser(workshop)
    before = len(tap.heard)
    browser.visit(f"{site.url}/fetch")
    wait_until("the page has posted", lambda: "/done" in site.asked)
    tab = browser.visit(f"{site.url}/form")
    wait_until("the form was answered", lambda: browser.shows(tab)[0] == f"http://127.0.0.1:{surface.port}/x")
    for piece in tap.heard[before:]:
        assert QUESTIONS["nexstar"].fullmatch(piece), piece
    assert not truth.goto_running()


def test_auto_detecting_port_serves_all_kinds_of_programs_at_once(workshop: Workshop) -> None:
    """Two drivers, a browser and Stellarium's own protocol: each sees the mount, and a goto of one is every one's."""
    requires("indiserver", LX200[0], NEXSTAR[0], "chromium-headless-shell")
    surface, truth = start(workshop, "nexstar")
    drivers = [Telescope(workshop, *driver, surface) for driver in (LX200, NEXSTAR)]
    browser = Browser(workshop)
    tab = browser.visit(f"http://127.0.0.1:{surface.port}/")
    wait_until("the page tells what the mount does", lambda: browser.shows(tab)[1] == "Tracking · 6-8se")
    drivers[0].goto(Spot(STAR.ra, STAR.dec))
    wait_until("arrival", lambda: not truth.goto_running())
    for telescope in drivers:
        scenario.shows_position(telescope, truth)
    assert arcseconds(told(surface.port), truth.position()) < 2400.0, "in J2000"
