"""Checks simulated mounts that are as the gateway believes, under all conditions that differ between real ones.

By chance, but the same for a seed: the version, the site in both hemispheres, a fork's wedge, the night, the mount's
clock, the line's delay, where the tube points and whether it tracks. What ``prove`` then calls a difference is a false
alarm. Afterwards tracking must be as it was, and the tube must not have been below the horizon.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from random import Random
from typing import Any
from unittest.mock import patch

from gateway.astro.axes import Build
from gateway.astro.spherical import horizon_to_hour_angle
from gateway.core import requests
from gateway.diagnostics.prove import small_motions
from gateway.diagnostics.prove.guide import STAGES
from gateway.diagnostics.prove.telescope import CLIENT
from gateway.protocols.wireformat.command_set import load
from tests.support.prove_setup import Onlooker, Proven, run_calm

MOUNTS = tuple(f"{protocol}:{model}" for protocol in ("nexstar", "lx200", "alpaca") for model in load(protocol).models)
CHECKS = 20
#: Seconds for which a mount slews at most before it is checked.
SLEWS = 120.0
#: Versions of hand controls that tell neither site nor mode nor model.
OLD = ("1.2", "1.6", "2.2", "101.0")
#: What may end a stage: a limit, or the Sun, which far from the equator is up in some of these nights.
ENDS = ("stopped at ", "° from the Sun, and the goto was refused: The way there passes too close to the Sun.")
#: 2026-01-01 0:00 UTC; seconds of a day.
JANUARY, DAY = 1767225600.0, 86400.0
#: What is known of a mount in the words of ``Proven``, and what is done to it before the gateway asks it anything.
Conditions = tuple[str, dict[str, Any], Callable[[Proven], None], bool]


def conditions(mount: str, seed: int) -> Conditions:
    """Return the mount with its version, the settings of ``Proven``, what points it, and whether it is to track."""
    by = Random(f"{mount} {seed}")
    protocol, _, model = mount.partition(":")
    row = load(protocol).models[model]
    version = by.choice(row["versions"]) if "versions" in row else None
    latitude, longitude = by.uniform(-65.0, 65.0), by.uniform(-180.0, 180.0)
    midnight = JANUARY + by.randrange(365) * DAY - longitude * 240.0
    settings: dict[str, Any] = {"site": (latitude, longitude), "start": midnight + by.uniform(-5.0, 5.0) * 3600.0}
    settings |= {"latency": by.uniform(0.01, 0.12), "every": 5.0}
    config: dict[str, Any] = {}
    if by.random() < 0.5 or version in OLD:
        config["site"] = (round(latitude, 2), round(longitude, 2))
    if protocol != "alpaca":
        settings["utc_offset"] = float(round(longitude / 15.0))
    if protocol == "nexstar" and by.random() < 0.4 and "synscan" not in mount:
        settings["wedge"] = True
    if version in OLD:  # their owners have to say more
        polar = "eq-north" if latitude > 0.0 else "eq-south"
        config |= {"at": f"{mount}@sim", "mode": polar if "wedge" in settings else "alt-az"}
    settings["config"] = config
    ahead, azimuth, altitude = by.uniform(-40.0, 40.0), by.uniform(0.0, 360.0), by.uniform(12.0, 80.0)

    def begin(proven: Proven) -> None:
        sim = proven.sim
        sim.mechanics.sky = sim.mechanics.sky._replace(clock_ahead=ahead)
        if protocol == "lx200":
            sim.clock_ahead = ahead  # type: ignore[attr-defined]
        point(proven, *horizon_to_hour_angle(azimuth, altitude, latitude))

    return f"{mount}/{version}" if version else mount, settings, begin, by.random() < 0.8


def point(proven: Proven, hour_angle: float, dec: float) -> None:
    """Let the mount slew there by itself, but for a fork's wedge to where its tube does not pass; it takes SLEWS."""
    sim = proven.sim
    if sim.mechanics.build is not Build.WEDGE or abs(dec) < 80.0:
        sim.mechanics.goto_sky(sim.now, sim.mechanics.sky.lst(sim.now) - hour_angle, dec)


def alarms(mount: str, seed: int, keys: tuple[int, ...] = tuple(small_motions.RATE_KEYS)) -> list[str]:
    """Check one true mount and return what is wrong with that; ``keys`` are the rates tried."""
    named, settings, begin, tracks = conditions(mount, seed)

    async def check() -> list[str]:
        async with Proven(named, change=begin, **settings) as proven:
            await asyncio.sleep(SLEWS)
            if not tracks:
                await proven.gateway.carry_out(requests.TrackRequest(on=False, who=CLIENT))
                await asyncio.sleep(5.0)
            before, person, notes = proven.sim.tracking, Onlooker(), list[str]()
            proven.gateway.wire_log.sinks.append(lambda entry: notes.append(entry.note))
            findings = await proven.check(person)
            wrong = [one.as_line for one in findings.select("differs")]
            ended = [line for line in person.said if line.startswith("This stage ends")]
            wrong += [line for line in ended if not any(words in line for words in ENDS)]
            wrong += [line for line in person.said if line.endswith("..")]
            left = [stage.name for stage in STAGES if stage.name != "place" and stage.name not in findings.stages]
            wrong += [f"{name} was not done" for name in left if not any("Not now" in line for line in person.said)]
            wrong += [note for note in notes if "internal error" in note]
            await asyncio.sleep(5.0)
            wrong += [f"tracking was {before}"] * (proven.sim.tracking != before)
            lowest = min(truth.altitude for truth in proven.truths)
            return wrong + [f"it was at an altitude of {lowest:.1f}°"] * (lowest < -0.1)

    with patch.object(small_motions, "RATE_KEYS", keys):
        found: list[str] = run_calm(check())
    return found
