"""Taps on an arrow: by LX200, NexStar and Alpaca programs, and at the mount's own keypad, judged by its true axes."""

from __future__ import annotations

import asyncio
import re
from typing import Any, NamedTuple

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.stage import RehearsalGateway
from tests.support.in_process_gateway import EVENING
from tests.support.truth import moving

#: The mounts: the simulated model, its protocol, and the rate of the tapped arrow that ASCOM programs choose there.
MOUNTS = {
    "cpc": ("cpc", "nexstar", 1.0),
    "cgem": ("cgem", "nexstar", 1.0),
    "lx200gps": ("lx200gps", "lx200", 2.0),
    "classic": ("lx200", "lx200", 2.0),
}
#: A mount without guide pulses of its own.
OLDER = {"cge": ("cge", "nexstar", 1.0)}
#: What is tapped: seconds that the finger is down, and response times of the mount's line.
LENGTHS, LATENCIES = (0.06, 0.08, 0.12, 0.2, 0.3, 0.6), (0.0, 0.02, 0.1, 0.15, 0.3)
#: Seconds of tracking that are compared, before the tap.
BEFORE = 2.0


class Face(NamedTuple):
    """A protocol's arrow: its surface, and the bytes before, of press (at a rate), release, and the other way."""

    presented: str
    surface: str | None
    before: bytes
    press: bytes
    release: bytes
    opposite: bytes = b""


FACES = {
    "lx200": Face("lx200", "autostar", b":RM#", b":Mn#", b":Qn#", b":Ms#"),
    "nexstar": Face(
        "nexstar", "6-8se", b"", b"P\x02\x11\x24\x07\0\0\0", b"P\x02\x11\x24\x00\0\0\0", b"P\x02\x11\x25\x07\0\0\0"
    ),
    "alpaca": Face(
        "alpaca", None, b"put connect\n", b"put moveaxis Axis=1 Rate=%.1f\n", b"put moveaxis Axis=1 Rate=0\n"
    ),
}


def stage(face: str, mount: str, latency: float, **settings: Any) -> RehearsalGateway:
    """Return a gateway with this surface over this mount."""
    model, driven, _ = (MOUNTS | OLDER)[mount]
    one = FACES[face]
    return RehearsalGateway(
        model, start=EVENING, driven=driven, presented=one.presented, surface=one.surface, latency=latency,
        named=True, **settings,
    )  # fmt: skip


class Axes:
    """The second axis of a simulated mount, without what tracking turns it."""

    def __init__(self, own: RehearsalGateway) -> None:
        self._own, self._loop = own, asyncio.get_running_loop()

    def _here(self) -> float:
        self._own.sim.advance_to_now()
        return float(self._own.sim.mechanics.axes(self._own.sim.now)[1])

    async def begin(self) -> None:
        """Measure tracking; what moves from now on counts."""
        before = self._here()
        await asyncio.sleep(BEFORE)
        self._since, self._start = self._loop.time(), self._here()
        self._drift = wrap180(self._start - before) / BEFORE

    async def rest(self, within: float) -> float:
        """Wait until the mount is at rest; return the seconds that took. Fails after ``within`` seconds."""
        began = self._loop.time()
        while moving(self._own.sim):
            assert self._loop.time() - began < within, f"it still moves after {within} s"
            await asyncio.sleep(0.01)
        return self._loop.time() - began

    @property
    def moved(self) -> float:
        """Degrees since ``begin``."""
        return wrap180(self._here() - self._start) - self._drift * (self._loop.time() - self._since)


async def at_keypad(mount: str, seconds: float, speed: float) -> float:
    """Return the degrees that the simulator moves when a key of its own keypad is held for so long."""
    async with stage("lx200", mount, 0.0) as own:
        axes, sim = Axes(own), own.sim
        await axes.begin()
        sim.advance_to_now()
        sim.mechanics.set_rate(sim.now, 2, speed)
        await asyncio.sleep(seconds)
        sim.advance_to_now()
        sim.mechanics.set_rate(sim.now, 2, 0.0)
        await asyncio.sleep(3.0)
        return axes.moved


class Tapped(NamedTuple):
    """A tap: degrees moved, its speed in degrees a second, seconds from the due halt to rest, and the refusals."""

    moved: float
    speed: float
    rest: float
    told: list[str]


async def tap(face: str, mount: str, seconds: float, latency: float) -> Tapped:
    """Tap an arrow once."""
    async with stage(face, mount, latency) as own:
        one, axes, speeds = FACES[face], Axes(own), list[float]()
        own.controller.reconciler.acknowledged.connect(
            lambda operation: (
                speeds.append(own.driver.speed(operation.rate))
                if isinstance(operation, op.Move | op.MoveAxis)
                else None
            )
        )
        client = own.client()
        client.send(one.before)
        await asyncio.sleep(1.0)
        await axes.begin()
        client.send(one.press % MOUNTS[mount][2] if b"%" in one.press else one.press)
        await asyncio.sleep(seconds)
        client.send(one.release)
        for _ in range(300):  # the press may wait for its turn
            await asyncio.sleep(0.01)
            if moving(own.sim):
                break
        rest = await axes.rest(3.0)
        await asyncio.sleep(2.0)
        assert not own.controller.wanted.hand_moves
        told = [notice.text for notice in own.controller.wire_log.recent_notices]
        return Tapped(axes.moved, speeds[0] if speeds else 0.0, rest, told)


async def judged(face: str, mount: str, seconds: float, latency: float) -> str:
    """Tap an arrow once, and return what is wrong with that; empty if nothing is."""
    moved, speed, rest, told = await tap(face, mount, seconds, latency)
    keypad = await at_keypad(mount, seconds, speed)
    most = keypad + speed * (0.1 + 2.0 * latency)
    told = [text for text in told if not re.search("this Meade|no nearer speed", text)]  # nearest rate
    if keypad / 2.0 <= abs(moved) <= most and rest <= 2.0 and not told:
        return ""
    return f"{moved:.4f} degrees, {keypad:.4f} at the keypad, at most {most:.4f}; at rest after {rest:.2f} s; {told}"
