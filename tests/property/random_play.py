"""One random play: a gateway in one process, several programs that say anything, a judge that watches.

``play`` is deterministic by its seed: virtual time, and chance from the seed alone.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import time
from random import Random
from typing import Any

from msgspec import Struct

from gateway.astro.axes import Observer
from gateway.core import operations as op
from gateway.core.errors import Fault, NotAligned
from gateway.core.wire_log import show
from gateway.diagnostics.virtual_time import run
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import parse_version
from tests.property import random_commands
from tests.property.random_judge import MOTION, Judge, TrueJudge, sidereal, sun, turned
from tests.support.in_process_gateway import Bridge, Visitor
from tests.support.manual_files import fits
from tests.support.owner import Owner

#: Mounts that are driven: protocol, model, version, all that there are; and what is presented over them.
STARSENSE = ("cgx", "evolution", "6-8se")
NEXSTAR = load("nexstar").models
MOUNTS: list[tuple[str, str, str | None]] = [
    *(("nexstar", model, version) for model, row in NEXSTAR.items() for version in row["versions"]),
    *(("nexstar", model, "starsense-1.20") for model in STARSENSE),
    *(("lx200", model, None) for model in load("lx200").models),
]
PRESENTED = {protocol: load(protocol).presented for protocol in ("lx200", "nexstar")}
#: 2026-06-21 10:00 UTC: day at 45 N 10 E; 2026-01-15 22:00 UTC: night. At 35 S 150 E it is so 14 hours later.
DAY, NIGHT, LATER = 1782036000.0, 1768514400.0, 14 * 3600.0
#: How long a reply may take; how long the noise of a program spoils what it says next; how long a play may take.
PATIENCE, SPOILT, WALL = 20.0, 5.0, 60.0
STEP = 0.1
#: Degrees from the Sun that the gateway keeps by default.
CIRCLE = 20.0
#: What a refusal of every goto says to do: nothing is lost then. A tube near a limit has to be moved by hand first.
WAYS_OUT = "Correct the one that is wrong", "with the arrows first"
#: Wrong clocks, in seconds, and wrong longitudes, in degrees beyond the true one.
AHEAD = (-7 * 3600.0, -2.5 * 3600.0, 1800.0, 3 * 3600.0, 12 * 3600.0, -2000 * 86400.0, 40.5 * 86400.0)
ASTRAY = (-140.0, -20.0, 3.0, 60.0, 180.0)


class Play(Struct):
    """What came of it. ``commanded`` counts the requests that the mount was sent."""

    name: str
    steps: int
    looks: int
    commanded: int
    complaints: list[str]
    worst: dict[str, float]
    said: list[str]


def cast(seed: int) -> tuple[tuple[str, str, str | None], str]:
    """Mount and presented protocol of a seed: all mounts in turn, two thirds of them under the other protocol."""
    mount = MOUNTS[seed % len(MOUNTS)]
    shared = seed // len(MOUNTS) % 3 == 2
    return mount, mount[0] if shared else ("lx200" if mount[0] == "nexstar" else "nexstar")


def play(
    seed: int, steps: int, mount: tuple[str, str, str | None], presented: str, contradicting: bool = False
) -> Play:
    """Play ``steps`` steps. ``mount`` is protocol, model, version; ``presented`` the protocol its clients speak.

    ``contradicting``: sources of site and time are wrong, and what happens is judged by the true ones.
    """
    return run(_play(seed, steps, mount, presented, contradicting))  # type: ignore[no-any-return]


class Scene(Struct):
    """Where a play takes place: what the bridge is built of, and the limits that hold."""

    name: str
    bridge: dict[str, Any]
    lowest: float
    highest: float
    latency: float
    face: str
    day: bool


def scene(random: Random, mount: tuple[str, str, str | None], presented: str, aligned: bool, highest: float) -> Scene:
    """A mount somewhere, by day or by night, on a quick line or a slow one."""
    driven, model, version = mount
    day, south = random.random() < 0.6, random.random() < 0.25
    face = random.choice(PRESENTED[presented])
    site = (-35.0, 150.0) if south else (45.0, 10.0)
    lowest = random.choice((0.0, 10.0, 15.0))
    config: dict[str, Any] = {"lowest": lowest, "highest": highest, "site": site}
    german = driven == "nexstar" and NEXSTAR[model]["mount"] == "german"
    config["mode"] = ("eq-south" if south else "eq-north") if german else "alt-az"
    start = (DAY if day else NIGHT) + LATER * south
    latency = random.choice((0.02, 0.05, 0.2))
    if version in ("1.2", "101.0"):
        latency = min(latency, 0.1)  # small gotos and looks fill a slower line, and reads wait long
    name = (
        f"{driven}:{model}{f'/{version}' if version else ''} as {presented}:{face}, "
        f"{'day' if day else 'night'}, {site}, {lowest}..{highest}, latency {latency}"
    )
    bridge = {
        "mount": model,
        "version": version,
        "site": site,
        "latency": latency,
        "aligned": aligned,
        "surface": face,
        "config": config,
        "driven": driven,
        "presented": presented,
        "start": start,
    }
    return Scene(name, bridge, lowest, highest, latency, face, day)


def wrong_sources(random: Random, here: Scene, mount: tuple[str, str, str | None]) -> set[str]:
    """Make sources of a scene wrong -> which. One of each kind that counts stays right, or nobody could know.

    A hand control that tells neither site nor clock has only the configuration and the computer, so they stay right.
    One that does not tell its site (Sky-Watcher) keeps the right one; one with a StarSense would lose its alignment.
    """
    driven, model, version = mount
    starsense = str(version).startswith("starsense")
    tells = driven == "lx200" or version is None or starsense or (2, 3) <= parse_version(version) < (100,)
    if driven == "lx200":  # what a program sets there is the mount's
        wrong = random.choice(({"program"}, {"configuration"}, {"computer"}, {"configuration", "computer"}))
    elif tells and not starsense and model != "skywatcher" and random.random() < 0.3:
        wrong = {"mount", "program"}
    else:
        wrong = {one for one in ("configuration", "computer") if tells and random.random() < 0.5} | {"program"}
    latitude, longitude = here.bridge["site"]
    if "configuration" in wrong:
        elsewhere = (-latitude, longitude), (latitude, longitude + random.choice(ASTRAY))
        north, east = random.choice(elsewhere)
        here.bridge["config"]["site"] = north, (east + 180.0) % 360.0 - 180.0
    if "computer" in wrong:
        here.bridge["host_ahead"] = random.choice(AHEAD)
    return wrong


async def _play(
    seed: int, steps: int, mount: tuple[str, str, str | None], presented: str, contradicting: bool = False
) -> Play:
    random = Random(seed)
    wild, aligned = random.random() < 0.2 and not contradicting, random.random() < 0.9 or contradicting
    here = scene(random, mount, presented, aligned, random.choice((75.0, 80.0, 90.0)))
    name = f"{here.name}{', wild' if wild else ''}{'' if aligned else ', not aligned'}"
    driven = mount[0]
    wrong = wrong_sources(random, here, mount) if contradicting else set()
    name += f", wrong: {', '.join(sorted(wrong))}" if wrong else ""
    made = Bridge(**here.bridge)
    if "mount" in wrong:
        latitude, longitude = here.bridge["site"]
        east = (longitude + random.choice((0.0, *ASTRAY)) + 180.0) % 360.0 - 180.0
        made.sim.relocate(Observer(latitude, east, random.choice(AHEAD)))  # type: ignore[attr-defined]
    async with made as bridge:
        synced = driven == "lx200" or bridge.driver.supports("s")  # else what is synced is what the gateway believes
        unsettles = random_commands.SITE_AND_CLOCK if synced else random_commands.SITE_CLOCK_AND_SYNC
        judged = TrueJudge if contradicting else Judge
        unsettles = re.compile(rb"(?!)") if contradicting else unsettles
        judge = judged(bridge, driven, here.lowest, here.highest, CIRCLE, unsettles, here.latency)
        player = _Player(bridge, random, driven, presented, here.face, wild, judge, synced, wrong)
        asyncio.get_running_loop().set_exception_handler(
            lambda _, context: player.judge.complain(f"nobody caught {context}")
        )
        ends = time.monotonic() + WALL
        done = 0
        while done < steps:
            done += await player.turn()
            if time.monotonic() > ends:
                player.judge.complain(f"{done} steps took more than {WALL:.0f} s")
                break
        await player.end()
        if wrong and not here.day:
            await player.nights_lost()
        return Play(
            f"seed {seed}: {name}", done, judge.looks, len(bridge.sent()), judge.complaints, judge.worst, player.said
        )


class _Player:
    """Two programs on two computers, and what they have said."""

    def __init__(
        self,
        bridge: Bridge,
        random: Random,
        driven: str,
        presented: str,
        face: str,
        wild: bool,
        judge: Judge,
        synced: bool,
        wrong: set[str],
    ) -> None:
        self.wrong, self.owner = wrong, Owner(bridge, driven) if wrong else None
        self.bridge, self.random, self.judge = bridge, random, judge
        self.driven, self.presented, self.face, self.wild, self.synced = driven, presented, face, wild, synced
        self.visitors = [bridge.client("127.0.0.1"), bridge.client("127.0.0.2")]
        self.spoilt = [0.0, 0.0]
        self.said: list[str] = []
        self._dumb_until = 0.0

    async def turn(self) -> int:
        """One idea of one program -> the number of steps it took."""
        if self.wrong and self.random.random() < 0.1:
            await self.random.choice((self.mislead, self.at_the_keys))()
            return 1
        number = self.random.randrange(2)
        if self.random.random() < 0.02:
            self.visitors[number].close()
            self.visitors[number] = self.bridge.client(f"127.0.0.{number + 1}")
            self.spoilt[number] = 0.0
        make = random_commands.lx200 if self.presented == "lx200" else random_commands.nexstar
        ideas = make(self.random, self.judge, self.face, self.wild, self.synced)
        for step in ideas:
            await self.step(number, step)
        await self.rest(self.random.choice((0.0, 0.0, 0.1, 0.3, 1.0, 3.0, 10.0)))
        return len(ideas)

    async def mislead(self) -> None:
        """A program sets a wrong site or clock, or at last the right one."""
        if "program" not in self.wrong:
            return
        (latitude, longitude), right = self.judge.sky[:2], self.random.random() < 0.2
        east = longitude + (0.0 if right else self.random.choice(ASTRAY))
        wrong: list[op.SetSite | op.SetClock] = [
            op.SetSite(latitude, (east + 180.0) % 360.0 - 180.0),
            op.SetClock(self.bridge.clock() + (0.0 if right else self.random.choice(AHEAD)), 0.0),
        ]
        told = self.random.choice(wrong)
        self.said.append(f"{self.bridge.clock() - self.judge.began:8.1f} s  {told!r}")
        with contextlib.suppress(Fault):
            await self.bridge.controller.perform(told)
        await self.rest(3.0)
        ra, dec = sun(self.judge.unix())
        sky = self.judge.sky
        over = op.Horizontal(*turned(sky.latitude, sidereal(self.judge.unix(), sky.longitude) - ra, dec))
        goal = self.random.choice((op.Equatorial(ra, dec), self.bridge.controller.astrometry.equatorial(over)))
        with contextlib.suppress(Fault):  # towards the Sun, on the sky of the mount or over its horizon
            east = goal.ra + self.random.uniform(-15.0, 15.0)
            await self.bridge.controller.perform(op.Goto(east % 360.0, goal.dec))
        await self.rest(self.random.choice((3.0, 30.0)))

    async def at_the_keys(self) -> None:
        """The owner sends the mount to an allowed place; where its way stays clear nothing may end that."""
        judge, controller = self.judge, self.bridge.controller
        await self.rest(5.0)
        if self.owner is None or self.owner.moving or controller.synced.value.size > 0.5 or self._may_be_silent():
            return
        if controller.movement.now().ending or controller.ends.ending:  # a stop is repeated until it is seen to hold
            return
        judge.lenient = "the owner's"
        az, alt = self.random.uniform(0.0, 360.0), self.random.uniform(judge.lowest + 15.0, 60.0)
        place = controller.astrometry.equatorial(op.Horizontal(az, alt))
        self.said.append(f"{self.bridge.clock() - judge.began:8.1f} s  the owner goes to {az:.1f}, {alt:.1f}")
        self.owner.goto(place.ra, place.dec)
        clear = "mount" not in self.wrong and self.driven == "nexstar"
        for _ in range(180):
            await self.rest(0.5)
            here = judge.believed()
            inside = judge.lowest + 3.0 < judge.altitude(*here) < judge.highest - 3.0
            clear = clear and inside and judge.from_sun(*here) > CIRCLE + 5.0
            if not self.owner.moving:
                break
        if clear and self.owner.ended():
            judge.complain(f"the owner's goto to {az:.0f}, {alt:.0f} was ended by {self.owner.ended()}")

    async def nights_lost(self) -> None:
        """Somewhere in the sky a goto is accepted, or a refusal says what is wrong and how to correct it."""
        controller, refused = self.bridge.controller, []
        for az, alt in ((az, alt) for az in range(15, 360, 30) for alt in (25.0, 45.0, 60.0)):
            goal = controller.astrometry.equatorial(op.Horizontal(float(az), alt))
            try:
                await controller.admission.admit(op.Goto(goal.ra, goal.dec))
            except NotAligned:
                return
            except Fault as fault:
                refused.append(str(fault))
            else:
                return
        if not any(way_out in words for words in refused for way_out in WAYS_OUT):
            self.judge.complain(f"a night lost: {sorted(set(refused))[:3]}")

    async def rest(self, seconds: float) -> float:
        """Let time pass, and the judge look -> the last speed."""
        speed = 0.0
        for _ in range(round(seconds / STEP)):
            await asyncio.sleep(STEP)
            speed = self.judge.look()
        return speed

    async def step(self, number: int, step: random_commands.Step) -> None:
        visitor = self.visitors[number]
        if step.shapes is not None and 0.0 < self.spoilt[number] <= self.bridge.clock():
            await self.clear(number)
        now = self.bridge.clock()
        spoilt = self.spoilt[number] > 0.0
        visitor.heard, silent = b"", self._may_be_silent()
        self.said.append(f"{now - self.judge.began:8.1f} s  {number}  {step.data!r}")
        visitor.tell(step.data)
        if step.shapes is None:
            self.spoilt[number] = now + SPOILT
        if step.shapes is None or spoilt:
            await self.rest(0.3)
            return
        self.judge.look()
        ends = now + (PATIENCE if step.shapes != "-" else 0.0)
        while not _whole(visitor, step) and self.bridge.clock() < ends:
            await asyncio.sleep(0.02 if self.bridge.clock() < now + 0.5 else STEP)
            self.judge.look()
            silent = silent or self._may_be_silent()
        if _whole(visitor, step):
            return
        if silent or self._may_be_silent() or self._withheld(step.data):  # it is late, if it comes at all
            self.spoilt[number] = self.bridge.clock() + SPOILT
        else:
            self.judge.complain(f"{step.data!r} got {visitor.heard!r}, not {step.shapes!r}")

    def _withheld(self, data: bytes) -> bool:
        """Whether the log has the reason why a program gets no reply to this; it tells it once."""
        begins = f"no reply to {show(data)}: the mount has not answered"
        return any(note.startswith(begins) for note in self.judge.unanswered)

    async def clear(self, number: int) -> None:
        """After noise: ask what has one answer, as programs do, until it comes."""
        visitor, silent = self.visitors[number], self._may_be_silent()
        asks, answers = (b"#:Gc#", (b"24#", b"12#")) if self.presented == "lx200" else (b"K!", (b"!#",))
        visitor.heard = b""
        visitor.tell(asks)
        ends = self.bridge.clock() + PATIENCE
        while not visitor.heard.endswith(answers) and self.bridge.clock() < ends:
            await asyncio.sleep(STEP)
            self.judge.look()
        self.spoilt[number] = 0.0
        if visitor.heard.endswith(answers):
            return
        if silent or self._may_be_silent():
            self.spoilt[number] = self.bridge.clock() + SPOILT
        else:
            self.judge.complain(f"{asks!r} after noise got {visitor.heard!r}")

    def _may_be_silent(self) -> bool:
        """A mount that sleeps, and one that is busy with itself, tell nothing for a while."""
        sim, now = self.bridge.sim, self.bridge.clock()
        if getattr(sim, "asleep", False) or now < getattr(sim, "busy_until", 0.0):
            self._dumb_until = now + 2.0 * PATIENCE
        return now < self._dumb_until

    async def end(self) -> None:
        """When all is said: stop, then it rests and still answers."""
        await self.rest(SPOILT + 1.0)
        if self.presented == "lx200":
            stop, wake, proof = [b"#", b":Q#"], b":hW#", random_commands.Step(b":GVP#", "[^#]+#")
        else:
            still = [bytes((80, 2, axis, 36, 0, 0, 0, 0)) for axis in (16, 17)]
            stop, wake, proof = [b"M", *still], b"y", random_commands.version(self.face)
        await self.rest(0.5)
        for data in (wake, *stop):
            self.visitors[0].tell(data)
            await self.rest(0.5)
        await self.rest(8.0)
        speed = await self.rest(0.5)
        if speed > MOTION and self.bridge.sim.mechanics.moving(
            self.bridge.clock()
        ):  # else it tracks a sky it has wrong
            self.judge.complain(f"goes on at {speed:.2f} deg/s after a stop")
        self.spoilt = [self.bridge.clock()] * 2
        for number in (0, 1):
            await self.step(number, proof)


def _whole(visitor: Visitor, step: random_commands.Step) -> bool:
    """Whether a reply is complete and has its shape."""
    heard, shapes = visitor.heard, step.shapes
    if isinstance(shapes, str):
        return fits(heard, shapes)
    if shapes:
        return len(heard) == shapes and heard.endswith(b"#")
    asked = step.data[7]
    return len(heard) in (asked + 1, asked + 2) and heard.endswith(b"#")
