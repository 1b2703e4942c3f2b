"""Syncs add up: it is their sum since the alignment that may not put the horizon somewhere else."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import SyncTooFar
from gateway.diagnostics.virtual_time import run
from gateway.mount.safety.sync_sum import SyncSum, check_sum
from tests.support.in_process_gateway import Bridge


async def sync_north(bridge: Any, degrees: float) -> Exception | None:
    """Sync that much farther north than the mount believes to point -> why not."""
    here = await bridge.controller.perform(op.Position())
    try:
        await bridge.controller.perform(op.Sync(here.ra, here.dec + degrees))
    except SyncTooFar as fault:
        return fault
    await asyncio.sleep(1.0)
    return None


def test_the_sum_is_taken_on_the_sky() -> None:
    assert SyncSum().added(op.Equatorial(350.0, 60.0), op.Equatorial(10.0, 60.0)).east == pytest.approx(10.0)
    assert SyncSum(3.0, 1.0).added(op.Equatorial(0.0, 0.0), op.Equatorial(0.0, 3.0)).size == pytest.approx(5.0)
    check_sum(15.0, SyncSum(0.0, 20.0), op.Equatorial(0.0, 20.0), op.Equatorial(0.0, 12.0), False)  # towards 0
    with pytest.raises(SyncTooFar):
        check_sum(15.0, SyncSum(0.0, 14.0), op.Equatorial(0.0, 20.0), op.Equatorial(0.0, 22.0), False)


@pytest.mark.parametrize(("mount", "taken"), [("cge", False), ("cpc", True)])
def test_near_the_pole_right_ascension_counts_in_full_on_an_equatorial_mount(mount: str, taken: bool) -> None:
    """56 degrees of right ascension at declination 75 are 14 on the sky, and turn a polar axis by 56."""

    async def program() -> None:
        async with Bridge(mount, config={"sun": 0.0}) as bridge:
            client = bridge.client()
            await client.ask(b":Sr06:00:00#:Sd+75*00:00#:MS#", until=b"0")
            for _ in range(60):
                client.tell(b":D#")
                await asyncio.sleep(1.0)
            here = await bridge.controller.perform(op.Position())
            try:
                await bridge.controller.perform(op.Sync(here.ra + 56.0, here.dec))
                assert taken
            except SyncTooFar:
                assert not taken

    run(program())


@pytest.mark.parametrize(("mount", "driven"), [("cpc", "nexstar"), ("cge", "nexstar"), ("lx200gps", "lx200")])
def test_small_syncs_do_not_add_up_beyond_the_limit(mount: str, driven: str) -> None:
    async def program() -> None:
        async with Bridge(mount, driven=driven) as bridge:
            if driven == "lx200":
                await sync_north(bridge, 0.1)  # a Meade is aligned by its first one
            assert await sync_north(bridge, 9.0) is None
            assert "18 degrees off with those since the alignment" in str(await sync_north(bridge, 9.0))
            assert await sync_north(bridge, 5.0) is None
            assert await sync_north(bridge, -10.0) is None
            assert await sync_north(bridge, 9.0) is None

    run(program())


def test_a_new_alignment_begins_anew() -> None:
    """The hand control is switched off and on, and aligned again."""

    async def program() -> None:
        async with Bridge("cpc") as bridge:
            assert await sync_north(bridge, 14.0) is None
            assert await sync_north(bridge, 14.0) is not None
            bridge.sim.aligned = False
            await bridge.controller.read_now(op.GetStatus())
            bridge.sim.aligned = True
            await bridge.controller.read_now(op.GetStatus())
            assert await sync_north(bridge, 14.0) is None

    run(program())


def test_a_jump_that_no_motor_makes_is_a_new_alignment() -> None:
    async def program() -> None:
        async with Bridge("cpc") as bridge:
            assert await sync_north(bridge, 14.0) is None
            mechanics, now = bridge.sim.mechanics, bridge.clock()
            client = bridge.client()
            for second in range(4):
                await client.ask(b":GR#")
                await asyncio.sleep(0.5)
                if second == 1:
                    ra, dec = mechanics.believed(bridge.clock())
                    mechanics.sync(bridge.clock(), ra + 30.0, dec)
            assert now < bridge.clock()
            assert bridge.controller.synced.value == SyncSum()

    run(program())


def test_the_sum_outlives_the_gateway(tmp_path: Path) -> None:
    async def program() -> None:
        async with Bridge("cpc", state=tmp_path) as first:
            assert await sync_north(first, 14.0) is None
        async with Bridge("cpc", state=tmp_path, on=first) as second:
            assert await sync_north(second, 14.0) is not None
            assert await sync_north(second, 0.5) is None

    run(program())
