"""A random play by hand near a limit: where plays of everything seldom come, and where most mistakes are.

The mount is sent to within some degrees of the horizon, of the upper limit, or of the Sun. There arrows and motors are
told anything in any order, on one axis or on both, while other programs ask. Deterministic by its seed.
"""

from __future__ import annotations

import asyncio
import contextlib
from math import cos, radians, sin
from random import Random

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.diagnostics.virtual_time import run
from tests.property import random_commands
from tests.property.random_judge import MOTION, Judge, sun
from tests.property.random_play import CIRCLE, MOUNTS, Play, scene
from tests.support.in_process_gateway import Bridge, Visitor

#: Scenes of a play, and how closely it is looked at, seconds.
SCENES, GLANCE = 3, 0.05
#: Degrees from a limit within which a scene begins.
NEAR = 8.0
#: The rates of a motor, 0 to 9: fast ones are what matters.
KEYS = (0, 5, 7, 8, 9, 9, 9)
#: What programs poll, and what keeps the line busy besides.
POLLED = {"lx200": b":GR#", "nexstar": b"e"}
BESIDES = {
    "lx200": [b":GA#", b":GZ#", b":GS#", b":GC#", b":D#", b":GW#", b":GD#", b":Gt#", b":GVP#"],
    "nexstar": [b"z", b"L", b"t", b"h", b"w", b"p", b"J", b"E", b"P\x01\x10\xfe\0\0\0\x02"],
}


def play(seed: int, scenes: int = SCENES) -> Play:
    """Play a seed: all mounts in turn, under either protocol."""
    return run(_play(seed, scenes))  # type: ignore[no-any-return]


async def _play(seed: int, scenes: int) -> Play:
    random = Random(seed)
    mount = MOUNTS[seed % len(MOUNTS)]
    presented = random.choice(("lx200", "nexstar"))
    here = scene(random, mount, presented, True, random.choice((60.0, 75.0, 80.0, 90.0)))
    async with Bridge(**here.bridge) as bridge:
        judge = Judge(bridge, mount[0], here.lowest, here.highest, CIRCLE, random_commands.SITE_AND_CLOCK, here.latency)
        hand = _Hand(bridge, random, judge, presented)
        for _ in range(scenes):
            await hand.scene()
        return Play(
            f"seed {seed}: {here.name}",
            len(hand.said),
            judge.looks,
            len(bridge.sent()),
            judge.complaints,
            judge.worst,
            hand.said,
        )


class _Hand:
    """Somebody at the arrows, and a program that asks."""

    def __init__(self, bridge: Bridge, random: Random, judge: Judge, presented: str) -> None:
        self.bridge, self.random, self.judge, self.presented = bridge, random, judge, presented
        self.hand, self.other = bridge.client("127.0.0.1"), bridge.client("127.0.0.2")
        self.busy = random.choice((0.0, 0.05, 0.3))
        self.said: list[str] = []

    async def scene(self) -> None:
        """Go near a limit, turn the axes any way, and stop."""
        ra, dec = self.place()
        with contextlib.suppress(Fault):
            await self.bridge.controller.perform(op.Goto(ra, dec))
        for _ in range(600):
            await self.rest(0.2)
            if not self.bridge.controller.slewing:
                break
        await self.rest(self.random.choice((0.1, 1.0, 5.0)))
        for _ in range(self.random.randrange(1, 7)):
            self.say(self.hand, self.words())
            await self.rest(self.random.choice((0.0, 0.1, 0.3, 0.5, 1.0, 2.0, 4.0)))
        await self.rest(3.0)
        self.bridge.controller.begin_stop()
        await self.rest(3.0)
        if await self.rest(0.5) > MOTION:
            self.judge.complain("goes on after a stop")

    def place(self) -> tuple[float, float]:
        """Right ascension and declination of an allowed place near a limit."""
        judge, random = self.judge, self.random
        while True:
            kind = random.randrange(3)
            if kind == 0:
                ra, dec = judge.at(random.uniform(0.0, 360.0), judge.lowest + random.uniform(0.05, NEAR))
            elif kind == 1:
                ra, dec = judge.at(random.uniform(0.0, 360.0), min(judge.highest, 89.9) - random.uniform(0.05, NEAR))
            else:
                ra, dec = sun(judge.unix())
                away, turn = judge.circle + random.uniform(0.05, NEAR), radians(random.uniform(0.0, 360.0))
                dec = max(-89.0, min(89.0, dec + away * sin(turn)))
                ra = (ra + away * cos(turn) / cos(radians(dec))) % 360.0
            if judge.lowest < judge.altitude(ra, dec) < judge.highest and judge.from_sun(ra, dec) > judge.circle + 0.02:
                return ra, dec

    def words(self) -> bytes:
        """One to three arrows or motors, as programs tell them."""
        random, count = self.random, self.random.choice((1, 1, 2, 3))
        if self.presented == "lx200":
            if random.random() < 0.15:
                return b":Q%c#" % random.choice(b"nsew")
            rate = random.choice((b":RS#", b":RS#", b":RM#", b":RC#", b""))
            return rate + b"".join(b":M%c#" % random.choice(b"nsew") for _ in range(count))
        if random.random() < 0.2:
            rate = random.choice((600, 14400, 0xE000)).to_bytes(2)
            return bytes((80, 3, random.choice((16, 17)), 6 + random.randrange(2))) + rate + bytes(2)
        motors = [(random.choice((16, 17)), 36 + random.randrange(2), random.choice(KEYS)) for _ in range(count)]
        return b"".join(bytes((80, 2, axis, sense, key, 0, 0, 0)) for axis, sense, key in motors)

    def say(self, visitor: Visitor, data: bytes) -> None:
        self.said.append(f"{self.bridge.clock() - self.judge.began:8.1f} s  {data!r}")
        visitor.tell(data)

    async def rest(self, seconds: float) -> float:
        """Let time pass while programs ask, and look closely -> the last speed."""
        speed = 0.0
        for _ in range(round(seconds / GLANCE)):
            await asyncio.sleep(GLANCE)
            speed = self.judge.look()
            if self.random.random() < 0.1:
                self.hand.tell(POLLED[self.presented])
            if self.random.random() < self.busy:
                self.other.tell(self.random.choice(BESIDES[self.presented]))
        return speed
