"""Debian's Stellarium, with the gateway as its telescope: *External software or a remote computer*."""

from __future__ import annotations

import socket
import struct

from .hand_control import HandControl
from .meade import Meade
from .processes import PATIENCE, Workshop, requires, wait_until
from .product import start_any_gateway, start_meade, start_simulator, start_stellarium_gateway
from .sky import NORTH, Spot, arcseconds
from .stellarium import Planetarium

#: Aldebaran, J2000, at the epoch of the night.
STAR = Spot(68.9838, 16.5079)
NEAR = 30.0
"""Seconds of arc by which the marker may be off: it is drawn at the position that is told last."""


def told(port: int) -> Spot:
    """The first position that a program is told, J2000."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as program:
        message = program.recv(24, socket.MSG_WAITALL)
    _, _, _, ra, dec, _ = struct.unpack("<HHQIii", message)
    return Spot(ra * 360.0 / 2**32, dec * 360.0 / 2**32)


def slews(program: Planetarium, number: int, port: int, truth: Meade | HandControl) -> None:
    """This telescope of Stellarium's goes to the star, and the port tells so."""
    program.slew(number)
    wait_until("the slew", truth.goto_running)
    wait_until("arrival", lambda: not truth.goto_running())
    wait_until("the position that is told", lambda: arcseconds(told(port), STAR) < NEAR)


def test_stellarium_shows_the_position_and_slews_the_mount(workshop: Workshop) -> None:
    """A Meade over a port of Stellarium's protocol, and a NexStar over one of any, which Stellarium's goto decides.

    Before the slew, and after it: on the star, whose place of date is 20 minutes of arc away.
    """
    requires("stellarium", "Xvfb", "xdotool")
    meade, truth_of_meade = start_meade(workshop, "lx200gps", NORTH, speed=4.0)
    nexstar, truth_of_nexstar = start_simulator(workshop, "nexstar:6-8se", NORTH, speed=4.0)
    own = start_stellarium_gateway(workshop, meade, "lx200").port
    shared = start_any_gateway(workshop, nexstar, "nexstar").port
    assert 300.0 < arcseconds(told(own), truth_of_meade.position()) < 2400.0, "it is in J2000, the mount is not"
    program = Planetarium(workshop, [own, shared], "Aldebaran", NORTH)
    slews(program, 1, own, truth_of_meade)
    slews(program, 2, shared, truth_of_nexstar)
