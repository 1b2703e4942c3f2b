"""After syncs that were wrong: motion by hand and tracking end where the tube really is, not where the mount says.

The axes of these mounts cannot be read, or do not tell the altitude. A sync lifts what the mount believes; the tube
stays as low as it was. Judged by where the tube truly points.
"""

from __future__ import annotations

from typing import Any

import pytest
from msgspec.structs import replace

from gateway.astro.axes import Build
from gateway.core import operations as op
from gateway.core.errors import Contradicted
from gateway.diagnostics.virtual_time import run
from tests.support.in_process_gateway import Bridge
from tests.support.instrument.attacks import assault, attacks
from tests.support.looks import altitude, at_rest, extremes, notes, sync, to
from tests.support.owner import Owner

LOWEST = 20.0
#: Driven protocol, mount, version, and how it stands.
MOUNTS = [
    ("lx200", "lx200", None, "fork on a wedge"),
    ("lx200", "lx200", None, "alt-az"),
    ("lx200", "lx200gps", None, "alt-az"),
    ("lx200", "lx200gps", None, "fork on a wedge"),
    ("lx200", "autostar", None, "german"),
    ("nexstar", "gt", "101.0", "alt-az"),
    ("nexstar", "cpc", "4.21", "fork on a wedge"),
    ("nexstar", "cge", "4.21", "german"),
    ("nexstar", "cgem", "5.31", "german"),
]
NAMES = [f"{mount}-{stands}" for _, mount, _, stands in MOUNTS]


def standing(driven: str, mount: str, version: str | None, stands: str, latitude: float, **config: Any) -> Bridge:
    config = {"lowest": LOWEST, "sun": 0.0, "site": (latitude, 10.0), **config}
    wedge = {"wedge": True} if driven == "nexstar" and stands == "fork on a wedge" else {}
    if mount == "gt":
        config["mode"] = "alt-az"
    bridge = Bridge(
        mount, version, driven=driven, site=(latitude, 10.0), config=config, surface="lx200gps", simulated=wedge
    )
    if driven == "lx200" and stands == "german":
        bridge.sim.mode_letter = "P"  # type: ignore[attr-defined]
        bridge.sim.mechanics.set_build(bridge.sim.now, Build.GERMAN)
    elif driven == "lx200":
        bridge.sim.feed(b":AA#" if stands == "alt-az" else b":AP#")
        bridge.sim.mechanics.correct(bridge.sim.now, (0.0, 0.0))  # a classic forgets its alignment
    return bridge


def arrow_down(stands: Any, latitude: float) -> bytes:
    """The arrow by which the second motor lowers a tube that looks over the equator; a Meade takes it for its own."""
    by_altitude = stands[0] == "lx200" and stands[3] == "alt-az"
    return b":Ms#" if latitude > 0.0 or by_altitude else b":Mn#"


@pytest.mark.parametrize("degrees", [3.0, 6.0, 10.0])
@pytest.mark.parametrize("latitude", [45.0, -33.0])
@pytest.mark.parametrize("stands", MOUNTS, ids=NAMES)
async def test_arrow_ends_before_the_limit_after_a_wrong_sync(stands: Any, latitude: float, degrees: float) -> None:
    async with standing(*stands, latitude) as bridge:
        down = arrow_down(stands, latitude)
        south = 180.0 if latitude > 0.0 else 0.0  # towards the equator: there declination leads down
        assert (await to(bridge, south + 20.0, 35.0))[0] is None
        await sync(bridge, south + 20.0, 35.0 + degrees)
        client = bridge.client()
        client.send(b":RS#" + down)
        for _ in range(60):
            client.send(b":GR#")
            await extremes(bridge, 0.25)
        low, _ = await at_rest(bridge)
        assert low > LOWEST - 1.0
        assert low < LOWEST + 8.0, "it went as far as it may"
        assert "the altitude limit" in "\n".join(notes(bridge))


@pytest.mark.parametrize("degrees", [3.0, 10.0])
@pytest.mark.parametrize("latitude", [45.0, -33.0])
@pytest.mark.parametrize("stands", MOUNTS, ids=NAMES)
async def test_tracking_ends_at_the_limit_after_a_wrong_sync(stands: Any, latitude: float, degrees: float) -> None:
    async with standing(*stands, latitude) as bridge:
        assert (await to(bridge, 270.0, LOWEST + 0.3))[0] is None
        await sync(bridge, 270.0, LOWEST + 0.3 + degrees)
        client, low = bridge.client(), 90.0
        for _ in range(60):
            await client.ask(b":GR#")
            low = min(low, (await extremes(bridge, 3.0))[0])
        ends = "tracking cannot be switched off" not in "\n".join(notes(bridge))
        assert ends is (stands[1] not in ("lx200", "gt"))
        assert (low if ends else LOWEST) == pytest.approx(LOWEST, abs=0.1)
        assert "if the syncs were wrong" in "\n".join(notes(bridge)) or stands[1] == "gt", "its axes tell"


@pytest.mark.parametrize("stands", [MOUNTS[0], MOUNTS[2], MOUNTS[7]], ids=["lx200", "lx200gps", "cge"])
async def test_mount_below_the_limit_after_a_sync_moves_only_upwards(stands: Any) -> None:
    async with standing(*stands, 45.0, lowest=0.0) as bridge:
        assert (await to(bridge, 200.0, 12.0))[0] is None
        await sync(bridge, 200.0, 22.0)
        context = bridge.controller.context
        context.policy = replace(context.policy, limits=replace(context.policy.limits, lowest=LOWEST))
        down, up = (op.Move(way, op.Rate(name="find")) for way in (op.Direction.SOUTH, op.Direction.NORTH))
        for refused in (down, op.Pulse(op.Direction.SOUTH, 2000)):
            with pytest.raises(Contradicted, match=r"syncs .* wrong"):
                await bridge.controller.perform(refused)
        await bridge.controller.perform(up)
        await extremes(bridge, 2.0)
        await bridge.controller.perform(op.StopAxis(2))
        assert altitude(bridge) > 13.0


@pytest.mark.parametrize("stands", [MOUNTS[0], MOUNTS[2], MOUNTS[7]], ids=["lx200", "lx200gps", "cge"])
@pytest.mark.safety_line(8)
async def test_goto_near_the_limit_is_refused_with_a_reason_after_a_sync(stands: Any) -> None:
    async with standing(*stands, 45.0) as bridge:
        assert (await to(bridge, 200.0, 35.0))[0] is None
        await sync(bridge, 200.0, 45.0)
        low = bridge.controller.astrometry.equatorial_of(op.Horizontal(180.0, LOWEST + 4.0))
        with pytest.raises(Contradicted, match=r"syncs .* wrong"):
            await bridge.controller.perform(op.Goto(low.ra, low.dec))


def test_goto_that_may_lead_below_the_limit_after_a_sync_is_not_begun() -> None:
    """From just above the limit, after a wrong sync at the pole: a stop would come too late."""
    attack = next(one for one in attacks() if one.name == "a sync of +14°, arrows down")
    result = run(assault(attack, "cgem", 5))
    assert not result.through, result


def test_keypad_motion_after_a_sync_ends_only_at_a_configured_limit() -> None:
    for lowest, ends in ((LOWEST, True), (None, False)):

        async def program(lowest: float | None = lowest, ends: bool = ends) -> None:
            given = {} if lowest is None else {"lowest": lowest}
            async with Bridge("lx200gps", driven="lx200", config={"sun": 0.0, **given}) as bridge:
                assert (await to(bridge, 180.0, 25.0))[0] is None
                await sync(bridge, 180.0, 35.0)
                client, owner = bridge.client(), Owner(bridge, "lx200")
                owner.keys("down")
                for _ in range(30):
                    await client.ask(b":GR#")
                    await extremes(bridge, 0.5)
                assert bool(owner.ended()) is ends
                owner.keys("let go")

        run(program())
