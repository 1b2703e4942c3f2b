"""INDI's OnStep driver on the simulated OnStep itself, without the gateway.

It was written for OnStep, by others, and asks for far more than the gateway does; when it is content with the
simulator, the other tests may take the simulator's word for what an OnStep answers.
"""

from __future__ import annotations

from . import scenario
from .processes import Workshop, requires
from .product import start_meade
from .sky import NORTH, same_site, target_up
from .telescope import Telescope

ARCMINUTE = 1.01
DRIVER, DEVICE = "indi_lx200_OnStep", "LX200 OnStep"


def test_night(workshop: Workshop) -> None:
    """Connect, read, goto, sync, abort, park, unpark, and what it shows of its state."""
    requires("indiserver", DRIVER)
    wire, truth = start_meade(workshop, "onstep", NORTH, speed=2.0)
    telescope = Telescope(workshop, DRIVER, DEVICE, wire)
    client = telescope.client
    assert same_site(telescope.site(), NORTH, ARCMINUTE), telescope.site()
    client.wait_for("the first poll", lambda: any(telescope.shown()), 40.0)
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.aborts(telescope, truth, target_up(truth.position(), 60.0, NORTH))
    status = client.wait_for_vector("OnStep Status").values
    assert "On-Step" in str(client.wait_for_vector("Firmware Info").values), status
    client.switch("TELESCOPE_PARK", "PARK")
    client.wait_for("parked", lambda: truth.ask(b":GU#")[2] == "P", 60.0)
    client.wait_for("parked, as shown", lambda: "Parked" in str(client.wait_for_vector("OnStep Status").values), 30.0)
    client.switch("TELESCOPE_PARK", "UNPARK")
    client.wait_for("unparked", lambda: "p" in truth.ask(b":GU#"), 30.0)
