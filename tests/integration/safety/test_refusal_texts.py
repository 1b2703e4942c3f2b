"""What a refused goto is told: true, short enough for a display, and with a way out.

A goal that is up is never said to be below the horizon: the digit is 2 then, with at most 60 characters. What comes of
a contradiction or of the way says nothing of ``lowest``, which is not the way out.
"""

from __future__ import annotations

import asyncio
import re
from typing import Any

import pytest

from gateway.app.control.requests import explain
from gateway.core import errors
from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.policy import Limits
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.process import Running, ask
from tests.unit.mount.site.test_sources import as_lx200

JUNE = 1782039600.0
SHOWN = 60


def faults(kind: type[Fault] = Fault) -> list[type[Fault]]:
    """Every class of refusal."""
    found = [one for below in kind.__subclasses__() for one in (below, *faults(below))]
    return [one for one in found if one.__module__ == errors.__name__]


@each("kind", faults())
def test_lx200_goto_refusal_says_low_only_for_low_targets(kind: type[Fault]) -> None:
    """By the class of the refusal alone, as the tables of :MS# have it."""
    replies = {reply.fault: reply.wire for reply, _ in load("lx200").commands["MS"].replies if reply.fault is not None}
    named = next((one.__name__ for one in kind.__mro__ if one.__name__ in replies), "BelowHorizon")
    about_the_mount = (errors.NoTarget, errors.NoAnswer, errors.NotAligned, errors.Stopped, errors.Refused)
    if issubclass(kind, (errors.TooHigh, errors.NearSun, errors.PastMeridian, errors.Held, errors.Busy)) or (
        kind is errors.Contradicted
    ):
        assert replies[named].startswith("2") and len(kind().brief or str(kind())) <= SHOWN
    else:
        assert replies[named].startswith("1") or kind in about_the_mount


@each("kind", faults())
def test_every_refusal_text_is_a_capitalised_sentence(kind: type[Fault]) -> None:
    fault = kind()
    for text in (str(fault), fault.brief or str(fault), explain(fault, Limits())):
        assert text[0].isupper() and text.endswith("."), text
    if not issubclass(kind, (errors.BelowHorizon, errors.TooHigh)) or issubclass(kind, errors.WayBlocked):
        assert "lowest" not in explain(fault, Limits())


#: A mount, its settings, and how far this computer's clock is ahead: what forbids a goto somewhere.
REFUSING: dict[str, tuple[str, dict[str, Any], float, float]] = {
    "another site": ("cge", {"site": (-33.9, 151.2), "lowest": 5.0}, 0.0, EVENING),
    "a site nearby": ("cge", {"site": (30.0, 40.0), "lowest": 5.0}, 0.0, EVENING),
    "another clock": ("cge", {"lowest": 5.0}, 6 * 3600.0, EVENING),
    "the other clock": ("avx", {"lowest": 5.0}, -5 * 3600.0, EVENING),
    "the Sun": ("cpc", {}, 0.0, JUNE),
    "the Sun of another clock": ("cge", {}, 3 * 3600.0, JUNE),
    "the Sun of another site": ("cpc", {"site": (45.0, 60.0)}, 0.0, JUNE),
    "the pier": ("6-8se", {"hour_angle_limit": 3.0}, 0.0, EVENING),
    "the way": ("cge", {"lowest": 30.0}, 0.0, EVENING),
    "the way over the top": ("cpc", {"highest": 60.0}, 0.0, EVENING),
    "a hold": ("cpc", {}, 0.0, EVENING),
}


@pytest.mark.parametrize("why", REFUSING)
def test_target_above_the_horizon_is_not_refused_as_low(why: str) -> None:
    mount, config, ahead, start = REFUSING[why]
    refused: list[bytes] = []

    async def program() -> None:
        async with Bridge(mount, config=config, host_ahead=ahead, start=start) as bridge:
            bridge.controller.hold.is_on = why == "a hold"
            if why == "the pier":
                bridge.sim.feed(b"T\x02")  # on its wedge
                await asyncio.sleep(10.0)
            lowest = config.get("lowest", 0.0)
            client, sky = bridge.client(), bridge.sim.mechanics.sky
            for hour_angle in range(-170, 180, 20):
                for dec in range(-40, 90, 25):
                    ra = (sky.lst(bridge.clock()) - hour_angle) % 360.0
                    altitude = bridge.controller.astrometry.alt_and_ha(op.Equatorial(ra, dec))[0]
                    assert altitude is not None
                    reply = (await client.ask(as_lx200(ra, float(dec)), 4.0, ending=b"#"))[2:]
                    if reply == b"0":
                        bridge.controller.begin_stop()
                        await asyncio.sleep(1.0)
                    elif altitude > lowest + 0.1:
                        refused.append(reply)
                        assert reply[:1] == b"2" and len(reply) <= SHOWN + 2, (altitude, reply)
                        assert b"orizon" not in reply and b"lowest" not in reply.lower()

    run(program())
    assert refused, "something was refused"


@pytest.mark.parametrize("why", ["another site", "another clock", "the Sun of another clock", "the pier", "the way"])
async def test_goto_refusal_mentions_the_lowest_limit_only_for_low_targets(why: str) -> None:
    mount, config, ahead, start = REFUSING[why]
    async with Bridge(mount, config=config, host_ahead=ahead, start=start) as bridge:
        sky, said = bridge.sim.mechanics.sky, set()
        lowest = config.get("lowest", 0.0)
        for hour_angle in range(-170, 180, 20):
            for dec in range(-40, 90, 25):
                ra = (sky.lst(bridge.clock()) - hour_angle) % 360.0
                up = (bridge.controller.astrometry.alt_and_ha(op.Equatorial(ra, dec))[0] or 0.0) > lowest + 0.1
                try:
                    await bridge.controller.admission.admit(op.Goto(ra, float(dec)))
                except Fault as fault:
                    words = explain(fault, bridge.controller.policy.limits)
                    if up:
                        assert "lowest" not in words, words
                    if "differ by" in words or "says" in words:
                        assert "Correct the one that is wrong" in words and (" km " in words or "differ" in words)
                    said.add(type(fault))
        assert said


async def test_warning_of_two_different_sites_names_both_and_how_to_set_each() -> None:
    async with Bridge("cge", config={"site": (10.0, 80.0)}) as bridge:
        await asyncio.sleep(2.0)
        [warning] = [entry.note for entry in bridge.entries if entry.note.startswith("WARNING: the mount stands")]
        for words in ("45.0 N 10.0 E", "10.0 N 80.0 E", "at its hand control", "the key site"):
            assert words in warning


@pytest.mark.parametrize("lowest", [None, 15.0])
async def test_refusal_of_a_low_target_gives_its_altitude_and_rising_time(lowest: float | None) -> None:
    """To programs in the form of a Meade, to people with values."""
    config = {} if lowest is None else {"lowest": lowest}
    async with Bridge("cge", config=config) as bridge:
        sky, height = bridge.controller.astrometry, lowest or 0.0
        goal = sky.equatorial_of(op.Horizontal(95.0, height - 6.0))
        with pytest.raises(errors.BelowHorizon) as refused:
            await bridge.controller.admission.admit(op.Goto(goal.ra, goal.dec))
        told = re.search(rf"\({height - 6.0:.0f}°\)\. It rises at (\d\d):(\d\d)", str(refused.value))
        assert told is not None and refused.value.brief.startswith("Object Below")
        minutes = (int(told[1]) * 60 + int(told[2]) - 22 * 60) % 1440
        place = bridge.controller.astrometry.site()
        then = bridge.clock() + minutes * 60.0
        rises = sky.sky.az_alt(goal.ra, goal.dec, place.latitude, place.longitude, then)[1]
        assert rises == pytest.approx(height, abs=0.3)


def test_terminal_of_run_shows_a_refusal_once_in_one_line() -> None:
    """It does not repeat it for a program that tries again."""
    settings = ("--no-discovery", "--no-status", "--sun", "0", "--no-watchdog")
    gateway = Running("run", "--mount", "nexstar:cge@sim", "--surface", "lx200@tcp://127.0.0.1:0", *settings)
    where = gateway.ready()
    for _ in range(2):
        assert ask(where, b":Sr06:00:00#:Sd-80*00:00#:MS#")[:3] == b"111"
    gateway.end()
    [line] = [line for line in gateway.said.splitlines() if "below the horizon" in line]
    assert re.search(r"\(-\d+°\)\. It does not rise here\.", line)
