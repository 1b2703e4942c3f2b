"""Hamlib's rotators, Meade and Celestron: each through the gateway, and each on the mount it was written for."""

from __future__ import annotations

import time

import pytest

from .alpaca_server import AlpacaServer
from .hamlib import CELESTRON, MEADE, Rotator, terminal_to
from .hand_control import HandControl
from .meade import Meade
from .processes import Workshop, requires, wait_until
from .product import start_alpaca_server, start_celestron_gateway, start_gateway, start_meade, start_simulator
from .sky import NORTH, SOUTH, Site, arcseconds

NEAR = 0.15
"""Degrees by which azimuth or elevation may be off: minutes of arc on the wire, 16 bits at the Celestron."""


def off(one: tuple[float, float], other: tuple[float, float]) -> float:
    """The larger of two differences, in degrees."""
    return max(abs((a - b + 180.0) % 360.0 - 180.0) for a, b in zip(one, other, strict=True))


def turns_and_stops(rotator: Rotator, truth: HandControl | Meade | AlpacaServer) -> None:
    """Read, turn, arrive; turn far away and stop on the way."""
    assert off(rotator.position(), truth.horizontal()) < NEAR
    azimuth, _ = truth.horizontal()
    target = (round((azimuth + 60.5) % 360.0, 1), 48.25)
    rotator.go(*target)
    wait_until("turning", truth.goto_running)
    wait_until("arrival", lambda: not truth.goto_running())
    assert off(truth.horizontal(), target) < NEAR, (truth.horizontal(), target)
    # What a gateway tells may be half a second old, and the last tenths of a degree are approached slowly.
    wait_until("arrival as it is told", lambda: off(rotator.position(), target) < NEAR)

    far = ((target[0] + 120.0) % 360.0, 55.0)
    rotator.go(*far)
    wait_until("turning again", lambda: off(truth.horizontal(), target) > 1.0)
    rotator.stop()
    wait_until("end of the goto", lambda: not truth.goto_running())
    wait_until("standstill", lambda: stands(truth))
    assert off(truth.horizontal(), far) > 1.0, "the mount went on to its target"


def stands(truth: HandControl | Meade | AlpacaServer) -> bool:
    """Whether the mount did not move between two looks; the sky passes it by at 15″/s meanwhile."""
    before = truth.position()
    time.sleep(0.25)
    return arcseconds(before, truth.position()) < 15.0


@pytest.mark.parametrize("site", [pytest.param(NORTH, id="north"), pytest.param(SOUTH, id="south")])
def test_hamlib_meade_drives_a_nexstar_mount_through_the_gateway(workshop: Workshop, site: Site) -> None:
    """Hamlib's LX200 model on the gateway's pseudo terminal, in front of a NexStar mount."""
    requires("rotctld")
    wire, truth = start_simulator(workshop, "nexstar:6-8se", site, speed=4.0)
    surface = start_gateway(workshop, wire, "autostar", "pty")
    turns_and_stops(Rotator(workshop, MEADE, surface.path), truth)


@pytest.mark.parametrize("site", [pytest.param(NORTH, id="north"), pytest.param(SOUTH, id="south")])
@pytest.mark.parametrize("mount", ["nexstar:cge", "nexstar:6-8se"])
def test_hamlib_parks_at_the_northern_horizon(workshop: Workshop, mount: str, site: Site) -> None:
    """Hamlib's own park, azimuth 0 and altitude 0, on a German mount and a fork, in both hemispheres."""
    requires("rotctld")
    wire, truth = start_simulator(workshop, mount, site, speed=8.0)
    rotator = Rotator(workshop, MEADE, start_gateway(workshop, wire, "autostar", "pty").path)
    rotator.go(150.0, 50.0)
    wait_until("arrival", lambda: not truth.goto_running())
    rotator.go(0.0, 0.0)
    wait_until("turning", truth.goto_running)
    wait_until("arrival", lambda: not truth.goto_running())
    wait_until("arrival as it is told", lambda: off(rotator.position(), (0.0, 0.0)) < NEAR)


@pytest.mark.parametrize("kind", ["altaz", "german"])
def test_hamlib_meade_drives_an_alpaca_mount_through_the_gateway(workshop: Workshop, kind: str) -> None:
    """Hamlib's LX200 model on the gateway's pseudo terminal, in front of a mount behind an Alpaca server."""
    requires("rotctld")
    wire, truth = start_alpaca_server(workshop, kind, NORTH, speed=4.0)
    turns_and_stops(Rotator(workshop, MEADE, start_gateway(workshop, wire, "autostar", "pty", "alpaca").path), truth)


def test_hamlib_celestron_drives_the_simulated_nexstar(workshop: Workshop) -> None:
    """Hamlib's NexStar model finds a NexStar in the simulator."""
    requires("rotctld", "socat")
    wire, truth = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=4.0)
    turns_and_stops(Rotator(workshop, CELESTRON, terminal_to(workshop, wire.port)), truth)


def test_hamlib_celestron_drives_a_meade_through_the_gateway(workshop: Workshop) -> None:
    """Hamlib's NexStar model on the gateway's pseudo terminal, in front of a Meade."""
    requires("rotctld")
    wire, truth = start_meade(workshop, "lx200gps", NORTH, speed=2.0)
    surface = start_celestron_gateway(workshop, wire, "pty")
    turns_and_stops(Rotator(workshop, CELESTRON, surface.path), truth)


def test_hamlib_meade_drives_the_simulated_meade(workshop: Workshop) -> None:
    """Hamlib's LX200 model finds a Meade in the simulator."""
    requires("rotctld", "socat")
    wire, truth = start_meade(workshop, "autostar", NORTH, speed=2.0, tolerant=True)
    turns_and_stops(Rotator(workshop, MEADE, terminal_to(workshop, wire.port)), truth)
