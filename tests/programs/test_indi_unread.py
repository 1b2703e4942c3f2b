"""INDI's LX200 drivers over TCP read one byte of a refused goto, and nothing of the reply to `:I#`.

They flush the rest, which has no effect on a socket: what the gateway sends must not shift their readings.
"""

from __future__ import annotations

import pytest

from . import scenario
from .processes import Workshop, requires
from .product import Endpoint, start_gateway, start_simulator
from .sky import NORTH, Spot, arcseconds, target_up
from .tap import Tap
from .telescope import POSITION, Telescope, spot_of
from .test_indi_lx200 import AUTOSTAR, BASIC, CLASSIC, FORK, GPS, SIXTEEN, SPEED, Driver

DEFAULT_POLLING = 1000
"""Milliseconds between two polls of a driver, if its user changes nothing."""
READS = 10


def reads_right(telescope: Telescope, tap: Tap, mark: int, there: Spot) -> None:
    """Ten readings later everything that the driver has shown since `mark` is where the mount is."""
    asked = b"".join(tap.heard).count(b":GD#")
    telescope.client.wait_for(f"{READS} positions asked", lambda: b"".join(tap.heard).count(b":GD#") >= asked + READS)
    shown = telescope.client.since(mark, POSITION)
    assert all(arcseconds(spot_of(vector), there) < scenario.NEAR for vector in shown), (there, shown)
    assert "Error reading RA/DEC." not in telescope.client.messages, telescope.client.messages[-6:]


@pytest.mark.parametrize(
    ("driver", "period"),
    [
        pytest.param(BASIC, DEFAULT_POLLING, id="basic"),  # the only one that does not begin unmistakably
        pytest.param(CLASSIC, 250, id="classic"),
        pytest.param(AUTOSTAR, 2000, id="autostar"),
        pytest.param(GPS, 250, id="gps"),
        pytest.param(SIXTEEN, 250, id="16"),
    ],
)
def test_refused_goto_leaves_replies_to_indi_lx200_in_step(workshop: Workshop, driver: Driver, period: int) -> None:
    requires("indiserver", driver.program)
    wire, truth = start_simulator(workshop, FORK, NORTH, speed=SPEED)
    tap = Tap(workshop, start_gateway(workshop, wire, driver.model, "tcp").port)
    telescope = Telescope(workshop, driver.program, driver.device, Endpoint("lx200", f"tcp://127.0.0.1:{tap.port}"))
    scenario.shows_position(telescope, truth)
    client = telescope.client
    client.set("POLLING_PERIOD", {"PERIOD_MS": str(period)})
    below = Spot((truth.position().ra + 180.0) % 360.0, -60.0)
    mark = len(client.history)
    client.switch("ON_COORD_SET", "TRACK")
    client.send(POSITION, {"RA": repr(below.ra / 15.0), "DEC": repr(below.dec)})
    client.wait_for("the refusal", lambda: any(one.state == "Alert" for one in client.since(mark, POSITION)))
    reads_right(telescope, tap, mark, truth.position())
    client.set("POLLING_PERIOD", {"PERIOD_MS": "250"})
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=driver.asks_end)


def test_unparking_leaves_replies_to_indi_lx200_in_step(workshop: Workshop) -> None:
    """LX200 GPS unparks by `:I#`, which an LX200GPS answers, and does not read the answer."""
    requires("indiserver", GPS.program)
    wire, truth = start_simulator(workshop, FORK, NORTH, speed=SPEED)
    tap = Tap(workshop, start_gateway(workshop, wire, GPS.model, "tcp").port)
    telescope = Telescope(workshop, GPS.program, GPS.device, Endpoint("lx200", f"tcp://127.0.0.1:{tap.port}"))
    telescope.park()
    scenario.wait_still(telescope, truth)
    telescope.client.listen(1.0)
    mark = len(telescope.client.history)
    telescope.unpark()
    telescope.client.wait_for("unparks", lambda: b":I#" in b"".join(tap.heard))
    telescope.client.wait_for("polls", lambda: b"".join(tap.heard).rpartition(b":I#")[2].count(b":GD#") >= READS)
    assert all(abs(vector.number("DEC")) < 180.0 for vector in telescope.client.since(mark, POSITION))
    assert "Error reading RA/DEC." not in telescope.client.messages, telescope.client.messages[-6:]
