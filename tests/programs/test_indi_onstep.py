"""INDI's OnStep driver on the simulated OnStep itself; its Celestron driver on OnStep and TeenAstro by the gateway.

The first was written for OnStep, by others, and asks for far more than the gateway does; when it is content with the
simulator, the other tests may take the simulator's word for what an OnStep answers.
"""

from __future__ import annotations

import pytest

from . import scenario
from .processes import Workshop, requires
from .product import start_celestron_gateway, start_meade
from .sky import NORTH, same_site, target_up
from .telescope import Telescope

ARCMINUTE = 1.01
DRIVER, DEVICE = "indi_lx200_OnStep", "LX200 OnStep"
CELESTRON = ("indi_celestron_gps", "Celestron GPS")


def test_indi_onstep_completes_a_night_on_the_simulated_onstep(workshop: Workshop) -> None:
    """Connect, read, goto, sync, abort, park, unpark, and what it shows of its state."""
    requires("indiserver", DRIVER)
    wire, truth = start_meade(workshop, "onstep", NORTH, speed=2.0)
    telescope = Telescope(workshop, DRIVER, DEVICE, wire)
    client = telescope.client
    assert same_site(telescope.site(), NORTH, ARCMINUTE), telescope.site()
    client.wait_for("the first poll", lambda: any(telescope.shown()))
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.aborts(telescope, truth, target_up(truth.position(), 60.0, NORTH))
    status = client.wait_for_vector("OnStep Status").values
    assert "On-Step" in str(client.wait_for_vector("Firmware Info").values), status
    client.switch("TELESCOPE_PARK", "PARK")
    client.wait_for("parked", lambda: truth.ask(b":GU#")[2] == "P")
    client.wait_for("parked, as shown", lambda: "Parked" in str(client.wait_for_vector("OnStep Status").values))
    client.switch("TELESCOPE_PARK", "UNPARK")
    client.wait_for("unparked", lambda: "p" in truth.ask(b":GU#"))


@pytest.mark.parametrize("model", ["onstep", "teenastro"])
def test_indi_celestron_completes_a_night_on_onstep_and_teenastro(workshop: Workshop, model: str) -> None:
    """Connect, read, goto, sync, abort: the gateway finds the controller without being told its name."""
    requires("indiserver", CELESTRON[0])
    wire, truth = start_meade(workshop, model, NORTH, speed=2.0)
    telescope = Telescope(workshop, *CELESTRON, start_celestron_gateway(workshop, wire, "tcp"))
    assert same_site(telescope.site(), NORTH, ARCMINUTE), telescope.site()
    scenario.shows_position(telescope, truth)
    scenario.goes_to(telescope, truth, target_up(truth.position(), 50.0, NORTH), exact_end=False)
    scenario.syncs(telescope, truth)
    scenario.aborts(telescope, truth, target_up(truth.position(), 60.0, NORTH))
