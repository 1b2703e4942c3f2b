"""What the gateway emulates and its bookkeeping live and die together: over restarts, a lost line, a power cycle.

A table: every value that the gateway keeps for a mount that cannot tell it, times what may happen in between. Either
the value counts afterwards and the mount has it, or it is gone everywhere, and one line says so.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from gateway.app.mount_state import mount_state
from gateway.core import operations as op
from gateway.core.errors import SyncTooFar
from tests.support.cable import Cable
from tests.support.in_process_gateway import Bridge
from tests.support.owner import Owner

OPEN = {"lowest": -90.0, "sun": 0.0}
AWAY = {"restart": 5.0, "killed": 5.0, "a night": 7200.0, "power cycle": 5.0, "reconnect": 5.0, "moved": 5.0}


class Value(NamedTuple):
    """``told`` returns what the gateway says of it, ``true`` what the mount has; ``survives`` what it outlasts."""

    driven: str
    model: str
    version: str | None
    set: op.Operation[Any]
    told: Callable[[Bridge], Awaitable[Any]]
    true: Callable[[Bridge], Any]
    survives: tuple[str, ...]
    first: tuple[bytes, ...] = ()


async def drive_rate(bridge: Bridge) -> float:
    return round(await bridge.controller.answer(op.DriveRate()), 3)


async def drifts(bridge: Bridge) -> float:
    before, began = bridge.sim.true_position()[0], bridge.clock()
    await asyncio.sleep(20.0)
    east = (bridge.sim.true_position()[0] - before) * 3600.0 / (bridge.clock() - began)
    return round(1.0 - east / 15.041, 3)


async def home(bridge: Bridge) -> int:
    return int(await bridge.controller.answer(op.HomeState()))


async def parked(bridge: Bridge) -> bool:
    return bool((await bridge.controller.answer(op.GetActivity())).parked)


async def guided(bridge: Bridge) -> float:
    return round((await bridge.controller.answer(op.GetAbilities())).guides[0], 2)


async def pulse(bridge: Bridge) -> float:
    """Return the guide rate by which a pulse of two seconds moves the tube."""
    before = bridge.sim.true_position()[1]
    await bridge.controller.perform(op.Pulse(op.Direction.NORTH, 2000))
    await asyncio.sleep(4.0)
    return round(abs(bridge.sim.true_position()[1] - before) * 3600.0 / 30.082, 1)


async def corrects(bridge: Bridge) -> bool:
    """Whether an order to turn it on leaves it on: a toggle would turn it off if the gateway was wrong."""
    await bridge.controller.perform(op.PeriodicError(1, True))
    return bool(bridge.sim.parts["pec 1"])


SHORT, ALWAYS = ("restart", "killed", "reconnect"), tuple(AWAY)
STANDS = ("restart", "killed", "a night", "reconnect", "moved")
VALUES = {
    "drive rate": Value("nexstar", "cge", "4.21", op.TrackRate(name="lunar"), drive_rate, drifts, SHORT),
    "guide rate": Value("nexstar", "cge", "4.21", op.SetGuideRate(1, 0.8), guided, lambda _: None, ALWAYS),
    "guide rate of a Meade": Value(
        "lx200", "lx200gps", None, op.SetGuideRate(2, 0.4), guided, pulse, ALWAYS, (b":AP#",)
    ),
    "home": Value("nexstar", "cge", "4.21", op.SetHome(), home, lambda _: None, ALWAYS),
    "parked": Value("nexstar", "cge", "4.21", op.Park(), parked, lambda bridge: not bridge.sim.tracking, STANDS),
    "corrections": Value("lx200", "lx200", None, op.PeriodicError(1, True), corrects, lambda _: None, SHORT),
}


async def happens(bridge: Bridge, event: str, state: Path) -> Bridge:
    """Let it happen; return the gateway afterwards."""
    owner = Owner(bridge, bridge._driven)
    if event == "reconnect":
        cable = Cable(bridge)
        cable.pull()
        await asyncio.sleep(AWAY[event])
        cable.plug()
        await asyncio.sleep(10.0)
        return bridge
    await (bridge.kill() if event == "killed" else bridge.__aexit__())
    await asyncio.sleep(AWAY[event])
    if event == "power cycle":
        await owner.power_cycle(2.0)
        bridge.sim.aligned = True
        if hasattr(bridge.sim, "mode_letter"):
            bridge.sim.ahead -= 100.0
            bridge.sim.feed(b":AP#")
        else:
            bridge.sim.relocate(bridge.sim.mechanics.sky._replace(clock_ahead=-100.0))
            bridge.sim.feed(b"T\2")
    if event == "moved":
        bridge.sim.true_position()
        bridge.sim.mechanics.correct(bridge.sim.now, (3.0, 0.0))
    again = Bridge(driven=bridge._driven, on=bridge, state=state, config=OPEN)
    return await again.__aenter__()


@pytest.mark.parametrize("event", AWAY)
@pytest.mark.parametrize("name", VALUES)
async def test_emulated_setting_is_forgotten_exactly_when_the_mount_loses_it(
    name: str, event: str, tmp_path: Path
) -> None:
    value = VALUES[name]
    if name == "corrections" and event in ("a night", "moved"):
        pytest.skip("nothing tells whether a toggle was reset")
    bridge = Bridge(value.model, value.version, driven=value.driven, state=tmp_path, config=OPEN)
    for data in value.first:
        bridge.sim.feed(data)
    await bridge.__aenter__()
    await bridge.controller.perform(op.Goto(bridge.sim.true_position()[0] - 30.0, 20.0))
    await asyncio.sleep(60.0)
    fresh = await value.told(bridge) if value.told is not corrects else False
    await bridge.controller.perform(value.set)
    await asyncio.sleep(90.0)
    told = await value.told(bridge)
    assert told != fresh
    bridge = await happens(bridge, event, tmp_path)
    await asyncio.sleep(8.0)
    now = await value.told(bridge)
    assert now == (told if event in value.survives or value.told is corrects else fresh)
    if value.true is drifts or value.true is pulse:
        assert await value.true(bridge) == pytest.approx(now, abs=0.03)
    elif value.true(bridge) is not None:
        assert value.true(bridge) is now
    if event not in value.survives and value.told is drive_rate:
        assert any("may have been switched off" in entry.note for entry in bridge.entries)
    await bridge.__aexit__()


# --- the offset that stands for syncs ----------------------------------------------------------------------------


@pytest.mark.parametrize("event", AWAY)
@pytest.mark.parametrize("version", ["3.04", "2.3"])
async def test_emulated_syncs_survive_a_restart_only_if_the_mount_is_unchanged(
    event: str, version: str, tmp_path: Path
) -> None:
    bridge = Bridge("cge", version, state=tmp_path, config=OPEN)
    await bridge.__aenter__()
    ask = bridge.controller.perform
    await ask(op.Goto(bridge.sim.true_position()[0] - 30.0, 20.0))
    await asyncio.sleep(60.0)
    here = await ask(op.Position())
    await ask(op.Sync(here.ra, here.dec + 6.0))
    await asyncio.sleep(20.0)
    bridge = await happens(bridge, event, tmp_path)
    ask, stays = bridge.controller.perform, event in SHORT
    there = await ask(op.Position())
    if event not in ("power cycle", "moved"):
        assert there.dec == pytest.approx(here.dec + 6.0 * stays, abs=0.01)
    assert bridge.controller.syncs.value.north == pytest.approx(6.0 * stays, abs=0.01)
    said = [entry.note for entry in bridge.entries if "sync again" in entry.note]
    status = [line for line in mount_state(bridge.controller).to_state().wanted if "sync again" in line]
    assert bool(said) is bool(status) is not stays
    done = 0
    with suppress(SyncTooFar):
        while done < 3:
            there = await ask(op.Position())
            await ask(op.Sync(there.ra, there.dec + 6.0))
            await asyncio.sleep(3.0)
            done += 1
    assert done == (1 if stays else 2)
    assert not [line for line in mount_state(bridge.controller).to_state().wanted if "sync again" in line]
    await bridge.__aexit__()


async def test_parked_fork_on_a_wedge_is_unparked_as_equatorial(tmp_path: Path) -> None:
    """While it does not track, no hand control tells that it stands on a wedge."""
    bridge = Bridge("cpc", "4.21", state=tmp_path, config=OPEN, simulated={"wedge": True})
    await bridge.__aenter__()
    await bridge.controller.perform(op.Park())
    await asyncio.sleep(90.0)
    bridge = await happens(bridge, "restart", tmp_path)
    await bridge.controller.perform(op.Unpark())
    await asyncio.sleep(5.0)
    assert bridge.sim.feed(b"t") == b"\2#"
    await bridge.__aexit__()
