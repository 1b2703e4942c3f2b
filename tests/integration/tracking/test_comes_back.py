"""What the gateway suspends or changes for a motion comes back as the mount had it, to the byte; and stars stand still.

A table: every setting of the drive that a mount tells, times every order that may touch it, times kinds of mounts. The
settings are read in the simulated mounts, drift is measured at the tube.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any, NamedTuple

import pytest

from gateway.astro.spherical import fold_declination, separation
from gateway.core import operations as op
from gateway.core.errors import Fault
from tests.support.in_process_gateway import Bridge

#: Arcseconds a second that a star may drift afterwards.
STILL = 0.005
#: Requests that turn tracking on.
SETS = re.compile(rb"T.|:A[APL]#|:Te#|PUT .*/tracking", re.DOTALL)
OPEN = {"lowest": -90.0, "sun": 0.0}


class Mount(NamedTuple):
    """``first`` is sent to the mount before the gateway starts, as its owner would set it up; the gateway carries out
    ``orders`` first, because the mount does not tell what they set.
    """

    driven: str
    model: str
    version: str | None = None
    first: tuple[bytes, ...] = ()
    orders: tuple[op.Operation[Any], ...] = ()


_GUIDE = b"P\x02\x10\x46\x40\0\0\0"  # AUX 0x46: a quarter of the sidereal rate
MOUNTS = (
    Mount("nexstar", "cge", "2.3", (_GUIDE,)), Mount("nexstar", "cge", "3.02", (_GUIDE,)),
    Mount("nexstar", "cge", "4.21", (_GUIDE, b"P\x02\x10\x0d\x01\0\0\0")), Mount("nexstar", "avx", "5.31", (_GUIDE,)),
    Mount("nexstar", "cpc", "4.21"), Mount("nexstar", "avx", "starsense-1.20"),
    Mount("nexstar", "synscan", "3.36", (b"T\3",)), Mount("nexstar", "synscan", "4.39.05", (b"T\3",)),
    Mount("nexstar", "synscan", "4.39.05", (b"T\2",)), Mount("nexstar", "synscan-az", "4.39.05"),
    Mount("lx200", "lx200gps", None, (b":AP#",), (op.SetGuideRate(1, 0.5), op.PeriodicError(1, True))),
    Mount("lx200", "lx200gps"), Mount("lx200", "autostar", None, (b":AP#",)), Mount("lx200", "lx200"),
    Mount("lx200", "onstep", None, (b":R0#", b":R4#")), Mount("lx200", "teenastro"), Mount("alpaca", "german"),
    Mount("alpaca", "altaz"), Mount("alpaca", "polar"),
)  # fmt: skip


async def arrow(bridge: Bridge, rate: str, direction: op.Direction) -> None:
    await bridge.controller.perform(op.Move(direction, op.Rate(name=rate)))
    await asyncio.sleep(2.0)
    await bridge.controller.perform(op.StopAxis(direction.axis))


async def goto(bridge: Bridge) -> None:
    here = await bridge.controller.answer(op.Position())
    await bridge.controller.perform(op.Goto(here.ra - 3.0, max(-60.0, min(60.0, here.dec + 2.0))))
    await asyncio.sleep(60.0)


async def park_and_unpark(bridge: Bridge) -> None:
    await bridge.controller.perform(op.Park())
    await asyncio.sleep(120.0)
    await bridge.controller.perform(op.Unpark())
    await asyncio.sleep(5.0)


async def pulses(bridge: Bridge) -> None:
    for direction in (op.Direction.EAST, op.Direction.WEST, op.Direction.NORTH):
        await bridge.controller.perform(op.Pulse(direction, 700))
        await asyncio.sleep(3.0)


async def sync(bridge: Bridge) -> None:
    here = await bridge.controller.answer(op.Position())
    await bridge.controller.perform(op.Sync(here.ra + 0.5, here.dec - 0.5 if here.dec > 0 else here.dec + 0.5))


async def moon_and_back(bridge: Bridge) -> None:
    await bridge.controller.perform(op.TrackRate(name="lunar"))
    await asyncio.sleep(3.0)
    await bridge.controller.perform(op.TrackRate(name="sidereal"))


async def motors(bridge: Bridge) -> None:
    await bridge.controller.perform(op.MoveAxis(1, 1, op.Rate(degrees=0.02)))
    await asyncio.sleep(2.0)
    await bridge.controller.perform(op.StopAxis(1))


async def tracking(bridge: Bridge) -> None:
    await bridge.controller.perform(op.SetTracking(on=True, heard=True))


async def off_and_on(bridge: Bridge) -> None:
    await bridge.controller.perform(op.SetTracking(on=False))
    await asyncio.sleep(3.0)
    await bridge.controller.perform(op.SetTracking(on=True))


async def stopped(bridge: Bridge) -> None:
    here = await bridge.controller.answer(op.Position())
    await bridge.controller.perform(op.Goto(here.ra - 20.0, here.dec * 0.8))
    await asyncio.sleep(2.0)
    await bridge.controller.perform(op.AbortMotion())


async def another_program(bridge: Bridge) -> None:
    one, other = bridge.client("10.0.0.2"), bridge.client("10.0.0.3")
    one.send(b":RC#:Mn#")
    await asyncio.sleep(1.0)
    other.send(b":RG#:Me#")
    await asyncio.sleep(1.0)
    one.send(b":Qn#")
    other.send(b":Qe#")


ORDERS: dict[str, Callable[[Bridge], Awaitable[None]]] = {
    "a slow arrow": lambda bridge: arrow(bridge, "guide", op.Direction.EAST),
    "a slow arrow north": lambda bridge: arrow(bridge, "guide", op.Direction.NORTH),
    "an arrow": lambda bridge: arrow(bridge, "find", op.Direction.WEST),
    "pulses": pulses,
    "motors": motors,
    "another program": another_program,
    "tracking on": tracking,
    "off and on": off_and_on,
    "the lunar rate and back": moon_and_back,
    "sync": sync,
    "goto": goto,
    "goto, stopped": stopped,
    "park and unpark": park_and_unpark,
}  # fmt: skip


def as_set(sim: Any) -> dict[str, object]:
    """Return what the mount has stored of its drive."""
    names = (
        "mode",
        "mode_letter",
        "accessories",
        "drive_rate",
        "guides",
        "tracks",
        "pulse_rate_number",
        "high_precision",
    )
    if sim.model == "onstep":  # nobody else tells the rate of its keys
        names += ("rate_number",)
    found = {name: getattr(sim, name) for name in names if hasattr(sim, name)}
    found |= {str(name): value for name, value in getattr(sim, "settings", {}).items()}
    found |= {name: sim.stored_values.get(name) for name in ("Rg", "Sw") if hasattr(sim, "stored_values")}
    return {name: value for name, value in found.items() if value}


async def drift(bridge: Any) -> float:
    """Return how fast the axes move against the mount's own sky, which a sync may have turned, arcseconds a second."""
    before, began = believed(bridge.sim), bridge.clock()
    await asyncio.sleep(20.0)
    return separation(*before, *believed(bridge.sim)) * 3600.0 / (bridge.clock() - began)


def believed(sim: Any) -> tuple[float, float]:
    sim.true_position()
    return fold_declination(*sim.mechanics.believed_position(sim.now))


@pytest.mark.parametrize("mount", MOUNTS, ids=lambda mount: "-".join(str(part) for part in mount[1:]))
async def test_drive_returns_to_its_previous_state_after_a_motion(mount: Mount) -> None:
    bridge = Bridge(mount.model, mount.version, driven=mount.driven, config=OPEN, latency=0.01, ramps=False)
    for data in mount.first:
        bridge.sim.feed(data)
    wrong = []
    async with bridge:
        await bridge.controller.perform(op.Goto(bridge.sim.true_position()[0] - 20.0, 30.0))
        await asyncio.sleep(60.0)
        for ordered in mount.orders:
            await bridge.controller.perform(ordered)
        for name, order in ORDERS.items():
            before, sent = as_set(bridge.sim), len(bridge.sent_requests())
            with suppress(Fault):  # this mount cannot do it
                await order(bridge)
            await asyncio.sleep(12.0)
            after = as_set(bridge.sim)
            wrong += [(name, key, before.get(key), after.get(key)) for key in before | after if before != after]
            moved = 15.0
            if not bridge.sim.tracking or (moved := await drift(bridge)) > STILL:
                wrong.append((name, "drift", STILL, moved))
            if order is tracking and (again := [one for one in bridge.sent_requests()[sent:] if SETS.match(one)]):
                wrong.append((name, "sent again", b"", again))
    assert not wrong


async def test_tracking_modes_pass_unchanged_between_a_program_and_a_synscan() -> None:
    bridge = Bridge("synscan", "4.39.05", presented="nexstar", surface=None, config=OPEN)
    bridge.sim.feed(b"T\3")
    async with bridge:
        client = bridge.client()
        assert await client.ask(b"t") == b"\3#"
        for mode in (b"\2", b"\3"):
            assert await client.ask(b"T" + mode) == b"#"
            assert bridge.sent_requests()[-1] == b"T" + mode
            assert await client.ask(b"t") == mode + b"#" == bridge.sim.feed(b"t")
        await client.ask(b"T\0")
        assert await client.ask(b"t") == b"\0#"
