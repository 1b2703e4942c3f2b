"""What somebody is told in advance of a goto is what the goto is told, for random goals from random places.

On mounts of every kind, under every kind of limit, by day and by night, and in every state in which a mount takes none.
"""

from __future__ import annotations

import asyncio
import contextlib
from random import Random
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from gateway.mount.readings.cache import MAX_AGE
from tests.support.in_process_gateway import EVENING, Bridge
from tests.support.sampling import as_a_rule

GOALS = as_a_rule(12, whole=60)
#: Model and protocol, limits, and the start: by night, or by day, when the Sun counts.
NIGHT, DAY = EVENING, EVENING - 11 * 3600.0
MOUNTS: dict[str, tuple[str, str, dict[str, Any], float]] = {
    "fork": ("cpc", "nexstar", {"lowest": 15.0, "highest": 75.0}, NIGHT),
    "fork-by-day": ("cpc", "nexstar", {"sun": 40.0}, DAY),
    "german": ("cge", "nexstar", {"lowest": 25.0, "highest": 80.0, "sun": 0.0}, NIGHT),
    "german-by-day": ("cge", "nexstar", {"sun": 40.0}, DAY),
    "meade-fork": ("lx200gps", "lx200", {"lowest": 20.0, "hour_angle_limit": 2.0}, NIGHT),
    "meade-german": ("lx200", "lx200", {"lowest": 20.0, "highest": 70.0, "sun": 30.0}, DAY),
    "wedge": ("cpc", "nexstar", {"hour_angle_limit": 2.0, "sun": 0.0}, NIGHT),
    "another-site": ("6-8se", "nexstar", {"site": (20.0, -30.0), "sun": 40.0}, DAY),
}


async def told(bridge: Bridge, ra: float, dec: float) -> tuple[str, str]:
    """What is told in advance, and what the goto is told then."""
    foreseen = await bridge.controller.preview_goto(op.Equatorial(ra, dec))
    try:
        await bridge.controller.perform(op.Goto(ra, dec), max_delay=10.0)
    except Fault as fault:
        return repr(foreseen), repr(fault)
    return repr(foreseen), repr(None)


async def rested(bridge: Bridge, random: Random) -> None:
    """Let a goto go some way, stop it or not, and read what a program polls."""
    await asyncio.sleep(random.choice((2.0, 20.0)))
    await bridge.controller.stop()
    await asyncio.sleep(6.0)
    for kind in (*MAX_AGE, op.Slewing):
        with contextlib.suppress(Fault):
            await bridge.controller.read(kind())


@pytest.mark.parametrize("kind", list(MOUNTS))
async def test_preview_of_a_goto_gives_the_answer_that_the_goto_gets(kind: str) -> None:
    model, driven, config, start = MOUNTS[kind]
    random, answers = Random(kind), set[str]()
    wedge = {"wedge": True} if kind == "wedge" else {}
    async with Bridge(model, driven=driven, start=start, config=config, simulated=wedge) as bridge:
        for number in range(GOALS):
            await rested(bridge, random)
            if number % 6 == 2:  # a sync turns the axes that tell the tilt
                here = await bridge.controller.read_now(op.Position())
                with contextlib.suppress(Fault):
                    await bridge.controller.perform(op.Sync((here.ra + 3.0) % 360.0, here.dec))
                await rested(bridge, random)
            near = config.get("lowest", 0.0) + random.uniform(-4.0, 4.0)
            altitude = random.choice((near, random.uniform(-20.0, 90.0)))
            goal = _above(bridge, random.uniform(0.0, 360.0), altitude)
            foreseen, answer = await told(bridge, *goal)
            assert foreseen == answer, (number, goal)
            answers.add(answer)
        assert len(answers) > 1, answers


@pytest.mark.parametrize("driven", ["nexstar", "lx200"])
@pytest.mark.parametrize("state", ["held", "not aligned", "asleep", "gone"])
async def test_preview_foresees_a_mount_that_refuses_every_goto(state: str, driven: str) -> None:
    model = "cpc" if driven == "nexstar" else "lx200gps"
    random = Random(state)
    async with Bridge(model, driven=driven, aligned=state != "not aligned", config={"sun": 0.0}) as bridge:
        await rested(bridge, random)
        if state == "held":
            bridge.controller.hold.is_on = True
        elif state == "asleep":
            with contextlib.suppress(Fault):
                await bridge.controller.perform(op.Hibernate())
        elif state == "gone":
            bridge.controller.line._mark_down("the mount does not answer")
        for alt in (40.0, -30.0):
            goal = _above(bridge, random.uniform(0.0, 360.0), alt)
            foreseen, answer = await told(bridge, *goal)
            if (state, driven) == ("asleep", "lx200") and alt > 0.0:  # its driver has words of its own for that
                answer = answer.replace("Refused('The mount is asleep: wake it first.')", foreseen)
            assert foreseen == answer
            assert answer != "None" or (state, driven, alt > 0.0) == ("not aligned", "lx200", True)
            with contextlib.suppress(Fault):
                await bridge.controller.stop()


@pytest.mark.parametrize("model", ["cpc", "cge"])
def test_preview_of_a_goto_sends_and_changes_nothing(model: str) -> None:
    """Not on the line, in the log, in what a motion under way is judged by, or in what is polled."""

    async def program() -> None:
        async with Bridge(model, start=DAY, config={"lowest": 20.0, "sun": 40.0}) as bridge:
            controller, random = bridge.controller, Random(model)
            await rested(bridge, random)
            places = [_above(bridge, azimuth, 50.0) for azimuth in range(0, 360, 30)]
            clear = [place for place in places if await controller.preview_goto(op.Equatorial(*place)) is None]
            await controller.perform(op.Goto(*clear[0]))
            await asyncio.sleep(1.0)

            def traces() -> list[object]:
                watched = controller.watch.next_path.min_altitude, controller.watch.next_path.allowed
                return [
                    watched,
                    len(bridge.entries),
                    len(bridge.sent_requests()),
                    dict(controller.cache._last_polled_at),
                ]

            before = traces()
            refused = [
                await controller.preview_goto(op.Equatorial(*_above(bridge, random.uniform(0.0, 360.0), altitude)))
                for altitude in (-10.0, 10.0, 30.0, 50.0, 70.0, 85.0)
            ]
            assert any(refused) and traces() == before

    run(program())


def _above(bridge: Bridge, azimuth: float, altitude: float) -> tuple[float, float]:
    """Return the position that is there now."""
    goal = bridge.controller.astrometry.equatorial_of(op.Horizontal(azimuth, altitude))
    return goal.ra, goal.dec
