"""What the driver of Alpaca telescopes makes of answers that no well-behaved server gives, step by step."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.astro.spherical import hour_angle_to_horizon
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, Refused, Silence, Unsupported
from gateway.protocols.alpaca.driver.contradictions import compare_equinox
from gateway.protocols.alpaca.driver.identify import identity, read_status
from gateway.protocols.alpaca.driver.motion import abort_motion, stop_axis
from gateway.protocols.alpaca.driver.pointing import goto, position
from gateway.protocols.alpaca.driver.state import AlpacaDriver
from gateway.protocols.base.driver import GotoUnderWay, Send, Steps

ABSENT = Unsupported("not there")


def play(steps: Steps, **answers: Any) -> tuple[list[str], Any]:
    """Answer every request of these steps; return what was sent, with its axis, and what they return or raise."""
    sent: list[str] = []
    try:
        step = next(steps)
        while True:
            if not isinstance(step, Send):
                step = steps.send(None)
                continue
            sent.append(step.command + str(step.values.get("axis", "")))
            answer = answers.get(step.command, ABSENT)
            if isinstance(answer, Fault):
                step = steps.throw(answer)
            else:
                step = steps.send(answer if isinstance(answer, dict) else {"value": answer})
    except StopIteration as end:
        return sent, end.value
    except NoAnswer as fault:
        return sent, fault


def driver(**facts: Any) -> AlpacaDriver:
    mount = AlpacaDriver(lambda: 0.0)
    for name, value in facts.items():
        setattr(mount, name, value)
    return mount


def test_alpaca_driver_stops_a_moving_axis_reported_as_not_movable() -> None:
    mount = driver(hand_rates={2: 4.0}, is_movable={1: False, 2: False})
    assert play(abort_motion(mount, op.AbortMotion()), moveaxis=None, abortslew=None)[0] == ["moveaxis1", "abortslew"]
    mount.hand_rates[1] = 4.0
    assert play(stop_axis(mount, op.StopAxis(1)), moveaxis=None)[0] == ["moveaxis0"]


@pytest.mark.parametrize("able", [ABSENT, Refused("busy"), True])
def test_alpaca_axis_counts_as_movable_until_canmoveaxis_is_false(able: Any) -> None:
    mount = driver()
    assert mount.may_be_moving(1) and mount.may_be_moving(2)
    play(identity(mount, op.GetIdentity()), connected=True, canmoveaxis=able, axisrates=[])
    assert mount.may_be_moving(1) and mount.may_be_moving(2) and not mount.supports("moveaxis")
    play(identity(mount, op.GetIdentity()), connected=True, canmoveaxis=False)
    assert not mount.may_be_moving(1) and not mount.may_be_moving(2)


@pytest.mark.parametrize("place", [("NaN", "NaN"), (1.0, float("inf")), (25.0, 10.0), (-1.0, 10.0), (1.0, 90.5)])
def test_position_is_read_anew_if_alpaca_device_state_holds_an_impossible_one(place: tuple[Any, Any]) -> None:
    mount = driver(lists_state=True)
    state = [{"Name": "RightAscension", "Value": place[0]}, {"Name": "Declination", "Value": place[1]}]
    answers = {"devicestate": state, "rightascension": {"ra": 15.0}, "declination": {"dec": 20.0}}
    sent, here = play(position(mount, op.Position()), **answers)
    assert sent == ["devicestate", "rightascension", "declination"] and (here.ra, here.dec) == (15.0, 20.0)


@pytest.mark.parametrize("state", [[], [{"Name": "RightAscension", "Value": 1.0}], Refused("busy")])
def test_tracking_or_park_state_missing_from_alpaca_devicestate_is_requested(state: Any) -> None:
    mount = driver(lists_state=True, tracks=True, parked=False)
    play(read_status(mount), devicestate=state, tracking=False, atpark=True)
    assert (mount.tracks, mount.parked) == (False, True)
    play(read_status(mount), devicestate=state, tracking=Refused("busy"), atpark=Refused("busy"))
    assert (mount.tracks, mount.parked) == (False, True)


def test_alpaca_stop_that_leaves_the_mount_moving_is_reported_as_refused() -> None:
    ranges = {1: ((0.0, 4.0),), 2: ((0.0, 4.0),)}
    with pytest.raises(Refused, match="stop was refused"):
        play(abort_motion(driver(goto=GotoUnderWay(began=0.0)), op.AbortMotion()), moveaxis=None, slewing=True)
    with pytest.raises(Refused, match="stop was refused"):
        play(abort_motion(driver(hand_rates={1: 1.0}, ranges=ranges), op.AbortMotion()), abortslew=None, slewing=True)
    play(abort_motion(driver(goto=GotoUnderWay(began=0.0)), op.AbortMotion()), moveaxis=None, slewing=False)
    assert play(abort_motion(driver(ranges=ranges), op.AbortMotion()), moveaxis=None)[0][0] == "abortslew"


@pytest.mark.parametrize("refracts", [True, False])
def test_refraction_in_altitudes_does_not_hide_a_wrong_equinox(refracts: bool) -> None:
    """It raises the tube by 1.6' at 31 degrees; the clock is 12 s wrong besides, and more is no agreement."""
    mount = driver(equinox="j2000", declares_equinox=True)
    place = {"siderealtime": 100.0, "rightascension": 100.0, "declination": -14.0, "sitelatitude": 45.0}
    azimuth, altitude = hour_angle_to_horizon(0.05, -14.0, 45.0)
    place |= {"azimuth": azimuth, "altitude": 10.0, "utcdate": 1768514400.0}
    play(identity(mount, op.GetIdentity()), connected=True, equatorialsystem=2, doesrefraction=refracts, **place)
    place["altitude"] = altitude + 0.027
    assert play(compare_equinox(mount), **place)[1] == ("jnow" if refracts else None)


def test_alpaca_arrow_is_never_faster_than_the_fastest_rate() -> None:
    mount = driver()
    rates = [{"Minimum": 0.004, "Maximum": 0.004}, {"Minimum": 10.0, "Maximum": 10.0}]
    play(identity(mount, op.GetIdentity()), connected=True, canmoveaxis=True, axisrates=rates)
    assert mount.ranges[1] == ((0.004, 0.004),) and mount.fit(1, op.Rate(name="max")) == 0.004
    play(identity(mount, op.GetIdentity()), connected=True, canmoveaxis=True, axisrates=rates[1:])
    assert mount.ranges[1] == () and not mount.supports("moveaxis")


def test_unconfirmed_alpaca_goto_is_aborted() -> None:
    """The server may take it so late that nobody would watch it."""
    answers = {"slewtocoordinatesasync": Silence(), "slewing": False, "abortslew": None}
    sent, fault = play(goto(driver(model="german"), op.Goto(10.0, 20.0)), **answers)
    assert sent == ["slewtocoordinatesasync", "slewing", "slewing", "abortslew"] and isinstance(fault, NoAnswer)
