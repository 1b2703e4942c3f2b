"""The motion mark: there while the mount moves, and whoever comes after a kill stops the mount before all else."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import pytest

from gateway.app.state.file import read_marker
from gateway.astro.spherical import separation
from gateway.core.operations import Tracking
from tests.support.in_process_gateway import Bridge

NEXSTAR_STOP = {b"P\2\x10$\0\0\0\0", b"P\2\x11$\0\0\0\0", b"M"}
GOTO = b":Sr07:00:00#:Sd+30*00:00#:MS#"


async def brisk(function: Any, *arguments: Any) -> Any:
    """A disk that takes longer than a motion takes to be sent, and less than anybody notices."""
    await asyncio.sleep(0.015)
    return function(*arguments)


def _mark(directory: Path) -> Path | None:
    return next(iter(directory.glob("*.moving")), None)


@pytest.mark.parametrize(
    ("mount", "motion"),
    [
        *((mount, motion) for mount in ("6-8se", "cge") for motion in (b":RC#:Mn#", b":Mw#", GOTO, b":hP#")),
        ("cge", b":Mge1000#"),
    ],
)
async def test_motion_mark_is_written_before_a_motion_and_removed_after_it(
    tmp_path: Path, mount: str, motion: bytes
) -> None:
    async with Bridge(mount, state=tmp_path, surface="lx200gps", speed=20, in_thread=brisk) as bridge:
        seen: list[bool] = []
        bridge.wire_log.sinks.append(
            lambda entry: (
                seen.append(_mark(tmp_path) is not None)
                if entry.side == "mount" and entry.arrow == ">" and entry.data[:1] in b"rbP"
                else None
            )
        )
        client = bridge.client()
        await asyncio.sleep(1)
        seen.clear()
        assert _mark(tmp_path) is None
        client.send(motion)
        await asyncio.sleep(0.7)
        assert seen[0]
        assert all(seen)
        if motion[:2] in (b":R", b":M") and b"g" not in motion:
            await asyncio.sleep(5)
            assert _mark(tmp_path), "it stays as long as the motion"
            client.send(b":Q#")
        await asyncio.sleep(60)
        assert not bridge.controller.reconciler.busy
        assert _mark(tmp_path) is None


@pytest.mark.parametrize("kind", [os.mkfifo, os.mkdir, Path.touch])
async def test_warning_names_an_unreadable_motion_mark(tmp_path: Path, kind: Callable[[Path], None]) -> None:
    """The mount is stopped; a pipe is replaced by the next mark, and a folder is told once more."""
    kind(mark := tmp_path / "nexstar@bridge.moving")
    async with Bridge(state=tmp_path) as bridge:
        told = bridge.warned[0]
        assert told.startswith(f"nexstar@bridge: the motion marker {mark} cannot be read, as if")
        assert told.endswith("stopped first")
        assert NEXSTAR_STOP & set(bridge.sent_requests())
        bridge.client().send(b":RC#:Mn#")
        await asyncio.sleep(1)
        assert mark.is_file() or "Is a directory" in bridge.warned[-1]


async def test_orders_that_do_not_move_the_mount_write_no_motion_mark(tmp_path: Path) -> None:
    async with Bridge(state=tmp_path) as bridge:
        for command in (b":GR#", b":Q#", b":RS#", b":SMx#", b":TS#", b":AL#", b":AA#", b":F+#"):
            bridge.client().send(command)
            await asyncio.sleep(1)
            assert _mark(tmp_path) is None, command


async def test_guiding_program_rarely_writes_to_the_disk(tmp_path: Path) -> None:
    writes = 0

    async def counting(function: Any, *arguments: Any) -> Any:
        nonlocal writes
        writes += 1
        return function(*arguments)

    async with Bridge("cge", state=tmp_path, in_thread=counting) as bridge:
        client = bridge.client()
        for number in range(100):
            client.send(b":Mg%c0200#" % b"nesw"[number % 4])
            await asyncio.sleep(2)
        assert writes <= 3


@pytest.mark.parametrize(
    ("mount", "version", "motion"),
    [
        ("6-8se", None, b":RS#:Mn#"),
        ("6-8se", None, GOTO),
        ("cge", None, b":RS#:Ms#"),
        ("nexstar-gps", "1.6", b":RS#:Mn#"),
    ],
)
async def test_stop_after_a_kill_goes_before_identification(
    tmp_path: Path, mount: str, version: str | None, motion: bytes
) -> None:
    kinds: dict[str, Any] = {
        "mount": mount,
        "version": version,
        "state": tmp_path,
        "config": {"mode": "alt-az"} if version else {},
    }
    async with Bridge(**kinds) as first:
        before = first.sim.tracking
        first.client().send(motion)
        await asyncio.sleep(2)
        assert not first.sim.tracking
        await first.kill()
        assert _mark(tmp_path)
        assert await _moves(first)
        async with Bridge(on=first, **kinds) as second:
            assert second.sent_requests()[0] == b"Kx"
            assert set(second.sent_requests()[1:4]) == NEXSTAR_STOP
            assert b"V" not in second.sent_requests()[:4]
            assert not await _moves(second)
            await asyncio.sleep(2)
            assert second.sim.tracking == before, "tracking is what it was before the motion"
            await asyncio.sleep(7)
            assert _mark(tmp_path) is None


async def test_mount_switched_off_since_the_kill_does_not_begin_to_track(tmp_path: Path) -> None:
    async with Bridge("cge", state=tmp_path) as first:
        first.client().send(b":RS#:Mn#")
        await asyncio.sleep(2)
        await first.kill()
        first.sim.aligned = False
        first.sim.track(0)
        async with Bridge("cge", state=tmp_path, on=first) as second:
            assert set(second.sent_requests()[1:4]) == NEXSTAR_STOP
            await asyncio.sleep(3)
            assert not [sent for sent in second.sent_requests() if sent[:1] == b"T"]
            assert not second.sim.tracking


async def _moves(bridge: Bridge) -> bool:
    """Whether the tube runs over the sky faster than it would with the drive off."""
    before = bridge.sim.true_position()
    await asyncio.sleep(1)
    after = bridge.sim.true_position()
    return separation(*before, *after) > 0.02


@pytest.mark.parametrize("mount", ["lx200", "lx200-16", "autostar", "lx200gps"])
@pytest.mark.parametrize("motion", [b"P\2\x10\x24\x09\0\0\0", b"r3B78EC00,0FA79E00"])
async def test_first_command_to_a_meade_after_a_kill_is_a_stop(tmp_path: Path, mount: str, motion: bytes) -> None:
    kinds: dict[str, Any] = {
        "driven": "lx200",
        "presented": "nexstar",
        "mount": mount,
        "surface": None,
        "state": tmp_path,
    }
    async with Bridge(**kinds) as first:
        await first.client().ask(motion)
        await asyncio.sleep(1)
        assert await _moves(first)
        await first.kill()
        assert _mark(tmp_path)
        async with Bridge(on=first, **kinds) as second:
            assert second.sent_requests()[0] == b":Q#"
            assert not await _moves(second)
            await asyncio.sleep(8)
            assert _mark(tmp_path) is None


async def test_motion_mark_stays_if_the_mount_never_heard_the_stop(tmp_path: Path) -> None:
    """The line is dead when the gateway ends: whoever comes next must stop the mount."""
    async with Bridge(state=tmp_path) as bridge:
        bridge.client().send(b":RS#:Mn#")
        await asyncio.sleep(2)
        bridge.controller.line.wire.feed = lambda data: b""  # type: ignore[attr-defined]
    assert _mark(tmp_path)
    async with Bridge(state=tmp_path, on=bridge) as after:
        assert set(after.sent_requests()[1:4]) == NEXSTAR_STOP
        await asyncio.sleep(9)
        assert _mark(tmp_path) is None


async def test_motion_mark_names_the_mount_its_baud_rate_and_tracking(tmp_path: Path) -> None:
    async with Bridge("cge", state=tmp_path) as bridge:
        bridge.client().send(b":RS#:Mn#")
        await asyncio.sleep(2)
        path = _mark(tmp_path)
        assert path is not None
        mark = read_marker(path)
        assert mark is not None
        written = msgspec.to_builtins(mark)
        assert 0.0 <= bridge.clock() - written.pop("at") < 3.0
        assert written.pop("motion")["speeds"] == {2: pytest.approx(4.5, abs=1.0)}
        assert written == {
            "mount": "nexstar@bridge",
            "baud": 9600,
            "memory": {"model": "cge", "version": [4, 21], "tracking": Tracking.EQ_NORTH.value},
        }
