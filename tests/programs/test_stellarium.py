"""Debian's Stellarium, with the gateway as its telescope: *External software or a remote computer*."""

from __future__ import annotations

import socket
import struct

from .processes import PATIENCE, Workshop, requires, wait_until
from .product import start_meade, start_stellarium_gateway
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


def test_stellarium_shows_the_position_and_slews_the_mount(workshop: Workshop) -> None:
    """Before the slew, and after Ctrl+1: on the star, whose place of date is 20 minutes of arc away.

    ``test_any_port.py`` has it slew a NexStar.
    """
    requires("stellarium", "Xvfb", "xdotool")
    wire, truth = start_meade(workshop, "lx200gps", NORTH, speed=4.0)
    surface = start_stellarium_gateway(workshop, wire, "lx200")
    before = told(surface.port)
    assert 300.0 < arcseconds(before, truth.position()) < 2400.0, "it is in J2000, the mount is not"
    Planetarium(workshop, surface.port, "Aldebaran", NORTH).slew()
    wait_until("the slew", truth.goto_running)
    wait_until("arrival", lambda: not truth.goto_running())
    wait_until("the position that is told", lambda: arcseconds(told(surface.port), STAR) < NEAR)
