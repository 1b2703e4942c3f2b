"""Legitimate evenings: gotos that an observer sends, four tenths of them low on purpose, and Hamlib's park.

What becomes of each is compared with the way that the mount alone would take. It is *harmless* if this way keeps 20
degrees from the risen Sun, and an altitude where somebody wrote one.
"""

from __future__ import annotations

from collections.abc import Coroutine, Iterator
from itertools import product
from random import Random
from typing import Any

from msgspec import Struct

from gateway.astro.spherical import separation
from tests.support.instrument.rules import rule_of
from tests.support.instrument.worlds import CIRCLE, KINDS, NOTHING, SITES, SLIPS, World, on_date

#: Gotos of one world.
GOTOS = 10
#: Degrees from its goal at which a goto has arrived; degrees beyond a limit that are rounding and running on.
ARRIVED, SLACK = 1.0, 0.4


class Told(Struct, frozen=True):
    """One goto. ``up``: its goal is, by the mount's own clock. ``lost``: refused or ended short, by ``rule``.
    ``through``: D1 or D2 if the tube really came there.
    """

    up: bool
    lost: bool
    words: str
    rule: str
    harmless: bool
    through: str


def goal_for(world: World, dice: Random, lowest: float, park: bool) -> tuple[float, float]:
    """Return azimuth and altitude of a goal: low ones are just above the limit."""
    if park:
        return 0.0, 0.0
    if dice.random() < 0.4:
        return dice.uniform(0.0, 360.0), lowest + dice.uniform(0.0, 6.0)
    return dice.uniform(0.0, 360.0), dice.uniform(lowest + 6.0, 86.0)


async def evening(
    kind: str, slip: str, day: bool, seed: int, lowest: float | None, park: bool, gotos: int = GOTOS
) -> list[Told]:
    """Play the gotos of one evening. ``lowest``: what the owner wrote, if anything; ``park``: Hamlib's, each time."""
    dice = Random(f"{kind} {slip} {day} {seed} {lowest} {park}")
    site = SITES[seed % len(SITES)]
    settings = SLIPS[slip]
    start, limits = on_date(dice, site, day), NOTHING if lowest is None else {"lowest": lowest}
    found: list[Told] = []
    async with World(kind, site, start, settings, limits) as world:
        if settings.phone:
            await world.set_clock(settings.phone)
        for number in range(2 * gotos if park else gotos):
            if number == 1 and settings.syncs[0]:
                await synced(world, dice, *settings.syncs)
            there = goal_for(world, dice, lowest or 0.0, park and number % 2 == 1)
            told = await one_goto(world, there, park and number % 2 == 1)
            found += [told] if number % 2 == 1 or not park else []
    return found


async def synced(world: World, dice: Random, times: int, degrees: float) -> None:
    for _ in range(times):
        ra, dec = await world.told_place()
        await world.sync(ra, max(-89.0, min(89.0, dec + degrees * (1 if dec < 0 else -1) * dice.choice((1, 1, -1)))))


async def one_goto(world: World, there: tuple[float, float], horizontal: bool) -> Told:
    """Send one goto; return what became of it."""
    goal = world.place(*there)
    believed = world.believed(goal)
    alone = world.alone(goal, there if horizontal else None)
    first = len(world.looks)
    world.look()
    words = await world.goto(*(there if horizontal else goal), horizontal)
    lost = bool(words)
    if not lost:
        await world.rest()
        here, off = world.looks[-1], separation(*alone.end, *world.sim.true_position())
        if horizontal:  # it may track there, or not
            off = min(off, separation(here.azimuth, here.altitude, *there))
        if off > ARRIVED:
            notes = world.notes()
            lost, words = True, next((note for note in notes if "stopped" in note), f"{off:.0f} degrees short")
    elif world.notes():
        words += f" | {world.notes()[-1]}"
    looks = world.looks[first:]
    world.looks = looks[-1:]
    near = min(look.sun for look in looks)
    through = "D1" if near < min(CIRCLE, looks[0].sun) - SLACK else ""
    through = "D2" if min(look.altitude for look in looks) < min(world.lowest, looks[0].altitude) - SLACK else through
    return Told(
        believed >= max(0.0, world.lowest) - 1e-3, lost, words, rule_of(words) if words else "",
        alone.keeps(world.lowest, 0.1), through,
    )  # fmt: skip


def evenings(gotos: int, seed: int) -> Iterator[Coroutine[Any, Any, list[Told]]]:
    """Yield the evenings of all slips with so many gotos by night and by day, all kinds of mount in turn."""
    for number in range(-(-gotos // (len(KINDS) * GOTOS))):
        for slip, day, kind in product(SLIPS, (False, True), KINDS):
            yield evening(kind, slip, day, seed + number, None, False)
