"""Checks every direction key and every guide pulse, at every rate, on every build, by the motion on the sky.

An LX200 program moves Celestron mounts, a NexStar program Meades. The measure is the simulated mount's truth: the
motion of the tube, or of an axis, beyond what tracking would have done meanwhile. Each motion must have the right sign,
be within 15 % of the rate in that mount's tables, and turn the other axis by no more than that.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, NamedTuple

from gateway.astro.axes import Build
from gateway.astro.spherical import SIDEREAL_RATE, horizon_to_hour_angle, hour_angle_to_horizon, wrap180
from gateway.core import operations as op
from gateway.diagnostics.virtual_time import run
from gateway.protocols.mechanics.truth import Truth, truth_of
from gateway.protocols.nexstar.counting import key_speed, rate_tables
from tests.support.in_process_gateway import Bridge

Pair = tuple[float, float]

NORTH, SOUTH = (45.0, 10.0), (-34.0, 18.5)
TOLERANCE = 0.15
#: The difference that two readings of the truth may have: degrees.
NOISE = 0.3 / 3600.0
#: Seconds until a motion is at full speed, for how long it is then measured, and for how long at guide rate.
BEFORE, MEASURED, SLOWLY = 1.6, 1.0, 4.0
PULSES_MS = (300, 2500)
#: Hour angle of the target, which decides on which side of the pier the tube of a German mount is.
PLACES = {"fork": 30.0, "german east": 35.0, "german west": -35.0, "alt-az": -35.0}
#: Axis and sign of an LX200 direction.
LETTERS = {"n": (2, 1), "s": (2, -1), "e": (1, -1), "w": (1, 1)}


class Scenario(NamedTuple):
    """One mount on one side of its pier; ``guide``: whether pulses refer to motor or sky directions."""

    program: str
    mount: str
    version: str | None
    build: str
    site: Pair
    guide: str = "motor"


class Row(NamedTuple):
    """One motion: degrees requested, and degrees measured along and across."""

    scenario: Scenario
    what: str
    direction: str
    asked: float
    seen: float
    across: float

    @property
    def right(self) -> bool:
        return abs(self.seen - self.asked) <= TOLERANCE * abs(self.asked) + NOISE and (
            abs(self.across) <= TOLERANCE * abs(self.asked) + NOISE
        )


NEXSTARS: tuple[tuple[str, str | None, str], ...] = (
    ("cpc", "4.21", "fork"), ("nexstar-gps", "4.21", "fork"), ("cge", "4.21", "german east"),
    ("cge", "4.21", "german west"), ("avx", "5.31", "german east"), ("avx", "5.31", "german west"),
    ("cpc", "4.21", "alt-az"), ("slt", "4.03", "alt-az"), ("evolution", "5.31", "alt-az"),
    ("nexstar-gps", "2.2", "alt-az"),
)  # fmt: skip
MEADES: tuple[tuple[str, str], ...] = (
    ("lx200gps", "fork"),
    ("lx200", "fork"),
    ("lx200-16", "fork"),
    ("autostar", "german east"),
    ("autostar", "german west"),
    ("lx200gps", "alt-az"),
    ("autostar", "alt-az"),
)


def scenarios() -> Iterator[Scenario]:
    """Yield all scenarios."""
    for (mount, version, build), site, guide in product(NEXSTARS, (NORTH, SOUTH), ("motor", "sky")):
        yield Scenario("lx200", mount, version, build, site, guide)
    for (mount, build), site in product(MEADES, (NORTH, SOUTH)):
        yield Scenario("nexstar", mount, None, build, site)


def _bridge(case: Scenario) -> Bridge:
    config: dict[str, Any] = {"lowest": -90.0, "sun": 0.0, "guide_directions": case.guide}
    if case.program == "lx200":
        if case.version == "2.2":  # it can report neither its site nor how it tracks
            config |= {"site": case.site, "mode": "alt-az"}
        return Bridge(case.mount, case.version, site=case.site, config=config, surface="lx200gps")
    bridge = Bridge(case.mount, driven="lx200", presented="nexstar", surface="cge", site=case.site, config=config)
    if case.build.startswith("german"):
        bridge.sim.mode_letter = "P"
        bridge.sim.mechanics.set_build(bridge.sim.now, Build.GERMAN)
    elif case.build == "fork":
        bridge.sim.feed(b":AP#")
    return bridge


# --- measuring ----------------------------------------------------------------------------------------------------


def on_the_sky(before: Truth, after: Truth, site: Pair) -> Pair:
    """Return degrees of hour angle and declination beyond tracking: west and north are positive."""
    first, second = (horizon_to_hour_angle(one.azimuth, one.altitude, site[0]) for one in (before, after))
    return wrap180(second[0] - first[0] - SIDEREAL_RATE * (after.t - before.t)), second[1] - first[1]


def on_the_axes(before: Truth, after: Truth, site: Pair, altaz: bool) -> Pair:
    """Return degrees of both axes beyond tracking, in their own sense of counting."""
    passed = SIDEREAL_RATE * (after.t - before.t)
    if altaz:
        hour_angle, dec = horizon_to_hour_angle(before.azimuth, before.altitude, site[0])
        there = hour_angle_to_horizon(hour_angle + passed, dec, site[0])
    else:
        there = before.axis1 + (passed if site[0] > 0 else -passed), before.axis2
    return wrap180(after.axis1 - there[0]), wrap180(after.axis2 - there[1])


# --- the motions --------------------------------------------------------------------------------------------------


async def _stand(bridge: Bridge, case: Scenario) -> None:
    """Go to the middle of the sky, on the side of the pier that the build demands."""
    if case.program == "lx200" and case.build == "fork":
        bridge.sim.feed(b"T\x02" if case.site[0] > 0 else b"T\x03")
    await asyncio.sleep(10.0)
    sidereal = await bridge.controller.answer(op.SiderealTime())
    dec = 25.0 if case.site[0] > 0 else -15.0
    await bridge.controller.perform(op.Goto((sidereal - PLACES[case.build]) % 360.0, dec))
    await asyncio.sleep(100.0)


async def _seen(
    bridge: Bridge, begin: Callable[[], None], end: Callable[[], None], seconds: float
) -> tuple[Truth, Truth]:
    """Measure a manual motion between two moments at which it is at full speed."""
    begin()
    await asyncio.sleep(BEFORE)
    before = truth_of(bridge.sim)
    await asyncio.sleep(seconds)
    after = truth_of(bridge.sim)
    end()
    await asyncio.sleep(4.0)
    return before, after


def _lx200_measure(case: Scenario, arrow: bool, before: Truth, after: Truth) -> Pair:
    """Direction keys mean the sky on an equatorial mount and the axes on an alt-az one; pulses as configured."""
    altaz = case.build == "alt-az"
    if altaz if arrow else case.guide == "motor" and case.build != "fork":
        first, second = on_the_axes(before, after, case.site, altaz)
        return (first if altaz or case.site[0] > 0 else -first), second  # in the south motor 1 turns with the sky
    return on_the_sky(before, after, case.site)


async def _lx200(bridge: Bridge, case: Scenario) -> list[Row]:
    client, rows = bridge.client(), []

    def tell(data: bytes) -> Callable[[], None]:
        return lambda: client.send(data)

    for name, words in (("RG", "guide"), ("RC", "center"), ("RM", "find"), ("RS", "max")):
        speed = bridge.driver.speed(op.Rate(name=words))
        for letter, (axis, sense) in LETTERS.items():
            client.send(f":{name}#".encode())
            seconds = SLOWLY if speed < 0.1 else MEASURED
            before, after = await _seen(bridge, tell(f":M{letter}#".encode()), tell(f":Q{letter}#".encode()), seconds)
            rows.append(
                _row(
                    case,
                    name,
                    letter,
                    sense * speed * (after.t - before.t),
                    axis,
                    _lx200_measure(case, True, before, after),
                )
            )
    for ms, (letter, (axis, sense)) in product(PULSES_MS, LETTERS.items()):
        rate = bridge.driver.guide_rates[axis] * SIDEREAL_RATE
        before, after = await _pulse(bridge, tell(f":Mg{letter}{ms:04d}#".encode()))
        rows.append(
            _row(
                case,
                f"pulse {case.guide} {ms} ms",
                letter,
                sense * rate * ms / 1000.0,
                axis,
                _lx200_measure(case, False, before, after),
            )
        )
    return rows


async def _pulse(bridge: Bridge, begin: Callable[[], None]) -> tuple[Truth, Truth]:
    await asyncio.sleep(3.0)
    before = truth_of(bridge.sim)
    begin()
    await asyncio.sleep(max(PULSES_MS) / 1000.0 + 3.0)
    return before, truth_of(bridge.sim)


async def _nexstar(bridge: Bridge, case: Scenario) -> list[Row]:
    """NexStar commands always mean motor directions, so the axes are measured."""
    client, rows, altaz = bridge.client(), [], case.build == "alt-az"

    def tell(*data: int) -> Callable[[], None]:
        return lambda: client.send(bytes(data))

    senses = [(axis, way) for axis in (1, 2) for way in (36, 37)]
    for key in (1, 2, 4, 6, 9):
        speed = bridge.driver.speed(op.Rate(key=key, degrees=key_speed(rate_tables()["se"], key)))
        for axis, way in senses:
            before, after = await _seen(
                bridge,
                tell(80, 2, 15 + axis, way, key, 0, 0, 0),
                tell(80, 2, 15 + axis, 36, 0, 0, 0, 0),
                SLOWLY if speed < 0.1 else MEASURED,
            )
            asked = (1 if way == 36 else -1) * speed * (after.t - before.t)
            rows.append(
                _row(
                    case,
                    f"key {key}",
                    f"{axis}{'+' if way == 36 else '-'}",
                    asked,
                    axis,
                    on_the_axes(before, after, case.site, altaz),
                )
            )
    for ms, (axis, way) in product(PULSES_MS, senses):
        percent = 100 if way == 36 else 156
        before, after = await _pulse(bridge, tell(80, 3, 15 + axis, 38, percent, ms // 10, 0, 0))
        asked = (1 if way == 36 else -1) * SIDEREAL_RATE * ms / 1000.0
        rows.append(
            _row(
                case,
                f"pulse 100 % {ms} ms",
                f"{axis}{'+' if way == 36 else '-'}",
                asked,
                axis,
                on_the_axes(before, after, case.site, altaz),
            )
        )
    return rows


def _row(case: Scenario, what: str, direction: str, asked: float, axis: int, moved: Pair) -> Row:
    return Row(case, what, direction, asked, moved[axis - 1], moved[2 - axis])


async def _play(case: Scenario) -> list[Row]:
    async with _bridge(case) as bridge:
        await _stand(bridge, case)
        return await (_lx200 if case.program == "lx200" else _nexstar)(bridge, case)


def play(case: Scenario) -> list[Row]:
    """Run all motions of one scenario, on virtual time."""
    return run(_play(case))
