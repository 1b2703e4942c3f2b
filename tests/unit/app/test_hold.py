"""A mount that is held is moved by no program until it is let go, over restarts too; all else goes on."""

from __future__ import annotations

import asyncio
import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.app.control.orders import carry_out_stop
from gateway.app.state import file as on_disk
from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.core.errors import Held
from gateway.core.motion_kinds import SEQUENTIAL_ORDERS
from gateway.core.requests import Answer, HoldRequest, ReleaseHoldRequest, StopOrHold
from gateway.mount.policy import Hold
from tests.support.in_process_gateway import Bridge

WORDS = b"The mount is held: type mount-gateway stop --release."
RATE = op.Rate(name="max")
HELD, RELEASED = Answer("done", "stopped and held"), Answer("done", "released")
#: All that takes its turn among the motions, and whether a held mount does it.
DONE: dict[op.Operation, bool] = {
    op.Goto(10.0, 20.0): False, op.GotoHorizontal(10.0, 50.0): False, op.GotoAxes(10.0, 20.0): False,
    op.Park(): False, op.Home(): False, op.AbortSlew(): True, op.Sync(10.0, 20.0): True,
    op.Move(op.Direction.NORTH, RATE): False, op.MoveAxis(1, 1, RATE): False, op.StopAxis(1): True,
    op.Pulse(op.Direction.NORTH, 100): False, op.PulseAxis(1, 1, 100): False,
    op.SetTracking(on=True): False, op.SetTracking(on=True, mode=op.Tracking.ALTAZ): False,
    op.SetTracking(on=False): True, op.TrackRate("sidereal"): True, op.SetHome(): False, op.Unpark(): False,
    op.Hibernate(): True, op.Wake(): False, op.Focus(1): True, op.Choose("LM"): True,
}  # fmt: skip
MOUNTS = [("nexstar", "6-8se"), ("nexstar", "cge"), ("lx200", "lx200"), ("lx200", "autostar"), ("lx200", "lx200gps")]


def test_stop_hold_allows_or_refuses_every_operation_as_declared() -> None:
    assert {type(operation) for operation in DONE} == set(SEQUENTIAL_ORDERS)
    held, free = Hold(), Hold()
    held.is_on = True
    for operation, done in DONE.items():
        free.check_allowed(operation)
        if done:
            held.check_allowed(operation)
        else:
            with pytest.raises(Held):
                held.check_allowed(operation)


async def _order(bridge: Bridge, request: StopOrHold) -> Answer:
    assert bridge.store is not None
    return await carry_out_stop(request, bridge.controller, bridge.store)


def _axes(bridge: Bridge) -> tuple[float, float]:
    bridge.sim.true_position()
    first, second = bridge.sim.mechanics.axes(bridge.sim.now)
    return float(first), float(second)


async def _rests(bridge: Bridge, seconds: float = 1.5) -> bool:
    """Whether the axes turn no faster than the sky."""
    before = _axes(bridge)
    await asyncio.sleep(seconds)
    after = _axes(bridge)
    return all(abs(wrap180(now - then)) < 0.006 * seconds for then, now in zip(before, after, strict=True))


LX200 = (b":RS#:Mn#", b":RG#:Me#", b":Mgn2000#", b":hP#", b":hF#", b":AL#:AP#", b":hW#", b":RS#:Mw#:Ms#")
NEXSTAR = (b"P\2\x10\x24\x09\0\0\0", b"P\2\x11\x25\x09\0\0\0", b"P\3\x10\x06\x40\0\0\0", b"b40000000,10000000",
           b"r40000000,10000000", b"B4000,1000", b"R4000,1000", b"T\2", b"y", b"P\3\x11\x26\x32\x64\0\0")  # fmt: skip


@pytest.mark.parametrize(("driven", "mount"), MOUNTS)
@pytest.mark.parametrize(("presented", "said"), [("lx200", LX200), ("nexstar", NEXSTAR)])
async def test_no_program_moves_a_mount_locked_by_stop_hold(
    tmp_path: Path, driven: str, mount: str, presented: str, said: tuple[bytes, ...]
) -> None:
    async with Bridge(mount, driven=driven, presented=presented, surface=None, state=tmp_path) as bridge:
        assert await _order(bridge, HoldRequest()) == HELD
        client = bridge.client()
        if presented == "lx200":
            await client.ask(b":AL#", 2.0)
        else:
            await client.ask(b"T\0", 2.0)
        tracking = bridge.sim.tracking
        for command in said:
            client.send(command)
            assert await _rests(bridge), command
            assert bridge.sim.tracking <= tracking, command
        assert any("The mount is held" in entry.note for entry in bridge.entries), "it is in the log"
        assert await client.ask(b":GR#" if presented == "lx200" else b"e")
        assert await _order(bridge, ReleaseHoldRequest()) == RELEASED
        client.send(said[0])
        assert not await _rests(bridge)


async def test_mount_locked_by_stop_hold_refuses_gotos_but_accepts_settings(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path) as bridge:
        assert await _order(bridge, HoldRequest()) == HELD
        client = bridge.client()
        assert await client.ask(b":Sr07:00:00#:Sd+30*00:00#", ending=b"11") == b"11"
        assert await client.ask(b":MS#", ending=b"#") == b"2" + WORDS + b"#"
        assert await client.ask(b":SMhere#:GM#", ending=b"e#") == b"1here#"
        assert await client.ask(b":Q#:GVP#") == b"Autostar#"


async def test_stop_hold_reports_the_mount_stopped_only_if_observed(tmp_path: Path) -> None:
    async with Bridge("cge", state=tmp_path) as bridge:
        client = bridge.client()
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2)
        assert not await _rests(bridge, 1.0)
        assert await _order(bridge, HoldRequest()) == HELD
        assert await _rests(bridge)
        assert bridge.sim.tracking, "it follows the sky as before"
        await _order(bridge, ReleaseHoldRequest())
        client.send(b":RS#:Mn#")
        await asyncio.sleep(2)
        bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
        answer = await _order(bridge, HoldRequest())
        assert not answer.is_ok
        assert answer.text.startswith("not stopped: ") and answer.text.endswith("; it is held from now on")
        assert bridge.controller.hold.is_on and on_disk.has_hold_file(tmp_path)
        logged = [entry.note for entry in bridge.entries if entry.arrow == "*"]
        assert logged == ["Hold: stopped and held", "Release: released", f"Hold: {answer.text}"]


async def test_stop_hold_survives_a_restart_and_is_reported_at_the_start(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path) as first:
        assert await _order(first, HoldRequest()) == HELD
    async with Bridge(state=tmp_path, on=first) as second:
        assert len(second.warned) == 1 and "stop --release" in second.warned[0]
        second.client().send(b":RS#:Mn#")
        assert await _rests(second)
        assert await _order(second, ReleaseHoldRequest()) == RELEASED
        second.client().send(b":RS#:Mn#")
        assert not await _rests(second)
    async with Bridge(state=tmp_path, on=first) as third:
        assert third.warned == []
        assert not third.controller.hold.is_on


async def test_stop_hold_that_cannot_be_saved_still_blocks_motion_and_warns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(folder: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    async with Bridge(state=tmp_path) as bridge:
        monkeypatch.setattr(on_disk, "write_hold_file", full)
        answer = await _order(bridge, HoldRequest())
        assert not answer.is_ok
        assert "a restart of the gateway forgets" in answer.text and f"{tmp_path}/hold" in answer.text
        bridge.client().send(b":RS#:Mn#")
        assert await _rests(bridge)
        assert await _order(bridge, ReleaseHoldRequest()) == RELEASED


async def test_stop_hold_also_stops_a_motion_that_is_being_sent(tmp_path: Path) -> None:
    for step in range(12):
        async with Bridge("cge", state=tmp_path / str(step)) as bridge:
            bridge.client().send(b":RS#:Mn#:Sr07:00:00#:Sd+30*00:00#:MS#")
            await asyncio.sleep(0.05 * step)
            assert await _order(bridge, HoldRequest()) == HELD
            bridge.client().send(b":Mw#:Me#")
            await asyncio.sleep(1)
            assert await _rests(bridge), step


@pytest.mark.parametrize("make", [
    Path.touch, Path.mkdir, lambda path: path.symlink_to("nowhere"),
    *([os.mkfifo] if hasattr(os, "mkfifo") else []),
])  # fmt: skip
def test_hold_file_of_any_kind_keeps_the_mount_locked(tmp_path: Path, make: Callable[[Path], Any]) -> None:
    assert not on_disk.has_hold_file(tmp_path)
    make(tmp_path / "hold")
    assert on_disk.has_hold_file(tmp_path)
    on_disk.write_hold_file(tmp_path)  # needs no other file, and waits for no other end of a pipe
    assert on_disk.has_hold_file(tmp_path)


def test_hold_file_names_its_command_and_is_removed_by_the_release(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "state"
    on_disk.write_hold_file(folder)
    on_disk.write_hold_file(folder)
    assert (folder / "hold").read_bytes().startswith(b"mount-gateway stop --hold: ")
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (
        on_disk.delete_hold_file(folder) and not on_disk.delete_hold_file(folder) and not on_disk.has_hold_file(folder)
    )
