"""Motion by hand near a limit: both axes count, and on which side of the pole or the zenith the tube is."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core import operations as op
from tests.support.in_process_gateway import Bridge
from tests.support.looks import altitude, extremes, notes

#: The hand control's motor commands: axis 17 is the altitude or declination motor, 36 its positive sense, rate 9.
UP, DOWN, STILL = b"P\x02\x11\x24\x09\0\0\0", b"P\x02\x11\x25\x09\0\0\0", b"P\x02\x11\x24\0\0\0\0"
WEST = b"P\x02\x10\x24\x09\0\0\0"


async def polled(bridge: Any, client: Any, question: bytes, seconds: float) -> tuple[float, float]:
    """A program that shows life meanwhile -> the lowest and the highest altitude of the tube."""
    seen: list[float] = []
    for _ in range(round(seconds * 2)):
        client.send(question)
        seen += await extremes(bridge, 0.5)
    return min(seen), max(seen)


async def ready(bridge: Any, client: Any, goto: bytes) -> None:
    """The goto is over, and the tube is known to be there."""
    client.send(goto)
    for _ in range(240):
        await asyncio.sleep(0.5)
        client.send(b"e")
        if not bridge.controller.slewing:
            break
    await asyncio.sleep(1.0)


@pytest.mark.parametrize(("driven", "model", "lowest"), [("nexstar", "cge", 40.4), ("lx200", "lx200", 32.4)])
async def test_second_arrow_is_refused_where_both_axes_together_would_cross_the_limit(
    driven: str, model: str, lowest: float
) -> None:
    """45 degrees high, two axes at full speed: the second one is refused where the first alone is still clear."""
    async with Bridge(model, driven=driven, config={"lowest": lowest}, latency=0.2) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 45.0) % 360.0, 20.0))
        await ready(bridge, client, b":GR#")
        assert altitude(bridge) == pytest.approx(45.4, abs=0.3)
        client.send(b":RS#:Mw#:Ms#")
        low, _ = await polled(bridge, client, b":GR#", 10.0)
        assert low >= lowest - 0.1, low
        assert any(note.startswith("Arrow: Object Below") for note in notes(bridge))
        assert not bridge.controller.moving


@pytest.mark.parametrize(("driven", "model"), [("nexstar", "evolution"), ("lx200", "autostar")])
async def test_arrow_up_past_the_zenith_ends_at_the_low_altitude_limit(driven: str, model: str) -> None:
    """A fork's motor that lifts the tube lowers it there: one hand control tells its axes, a Meade shows it."""
    async with Bridge(model, driven=driven, presented="nexstar", surface="6-8se", config={"lowest": 60.0}) as bridge:
        client = bridge.client()
        place = bytes(f"b{0x80000000:08X},{int(80 / 360 * 2**32):08X}", "ascii")
        await ready(bridge, client, place)
        assert altitude(bridge) == pytest.approx(80.0, abs=0.1)
        client.send(UP)
        low, high = await polled(bridge, client, b"e", 12.0)
        assert high > 89.0
        assert low >= 59.9
        assert not bridge.controller.moving
        for _ in range(3):  # near the limit now: further down not at all, back up at once
            client.send(UP)
            low, _ = await polled(bridge, client, b"e", 3.0)
            assert low >= 59.9, low
        assert any("Object Below" in note for note in notes(bridge))
        client.send(DOWN)
        await asyncio.sleep(2.0)
        assert altitude(bridge) > low + 1.0
        client.send(STILL)
        await asyncio.sleep(1.0)


@pytest.mark.parametrize(("arrow", "dec", "lowest"), [(UP, 34.5, 20.0), (DOWN, -84.5, 40.0)])
async def test_declination_motor_of_a_meade_in_the_south_counts_north_as_positive(
    arrow: bytes, dec: float, lowest: float
) -> None:
    """Positive is north in both hemispheres, though the axis reading grows towards the pole."""
    south = (-35.0, 150.0)
    async with Bridge(
        "lx200-16",
        driven="lx200",
        presented="nexstar",
        surface="i-series",
        site=south,
        config={"lowest": lowest, "site": south},
    ) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 1.0) % 360.0, dec))
        await ready(bridge, client, b"e")
        assert altitude(bridge) == pytest.approx(lowest + 0.5, abs=0.2)
        client.send(arrow)
        low, _ = await polled(bridge, client, b"e", 6.0)
        assert low >= lowest, low


async def test_arrow_north_moves_north_from_beyond_the_pole() -> None:
    """A hand control tells a declination beyond 90 degrees there."""
    async with Bridge("cge", config={"lowest": -90.0}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 45.0) % 360.0, 85.0))
        await ready(bridge, client, b":GR#")
        client.send(b":RS#:Mn#")
        await asyncio.sleep(3.5)
        client.send(b":Qn#")
        await asyncio.sleep(2.0)
        beyond = bridge.sim.mechanics.true_position(bridge.clock())[1]
        assert beyond < 86.0
        await client.ask(b":GD#")
        client.send(b":RM#:Mn#")
        await asyncio.sleep(1.5)
        client.send(b":Qn#")
        await asyncio.sleep(1.0)
        assert bridge.sim.mechanics.true_position(bridge.clock())[1] > beyond + 0.5


@pytest.mark.parametrize("moves", [b":RS#:Mn#", b":MS#"])
async def test_sync_is_refused_while_the_mount_moves(moves: bytes) -> None:
    """Nothing is centred then; a bare # is what programs read as failure."""
    async with Bridge() as bridge:
        client = bridge.client()
        hours = (bridge.sim.mechanics.sky.lst(bridge.clock()) / 15.0 - 2.0) % 24.0
        await client.ask(f":Sr{int(hours):02d}:00:00#:Sd+20*00:00#".encode())
        client.send(moves)
        await asyncio.sleep(1.0)
        assert await client.ask(b":CM#") == b"#"
        assert any("sync when it has stopped" in note for note in notes(bridge))
        client.send(b":Q#")
        await asyncio.sleep(3.0)
        assert not any(sent.startswith(b"s") for sent in bridge.sent_requests())
        ra, dec = bridge.sim.mechanics.true_position(bridge.clock())
        await bridge.controller.perform(op.Sync(ra, dec + 1.0))
        assert any(sent.startswith(b"s") for sent in bridge.sent_requests())


@pytest.mark.parametrize(("arrow", "way"), [(b":Mn#", 1), (b":Ms#", -1)])
async def test_arrow_north_that_interrupts_a_meridian_flip_goes_north(arrow: bytes, way: int) -> None:
    """Under way the hand control tells the side of the goal; the motors go by the side where the tube is."""
    async with Bridge("cgx", "5.31", config={"lowest": -30.0}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal - 40.0) % 360.0, 20.0))
        await ready(bridge, client, b":GR#")
        await bridge.controller.perform(op.Goto((sidereal + 40.0) % 360.0, 20.0))
        await asyncio.sleep(3.0)
        client.send(b":RS#" + arrow)
        await asyncio.sleep(2.5)  # from the full speed of the goto to that of the arrow
        before = bridge.sim.mechanics.true_position(bridge.clock())[1]
        await asyncio.sleep(0.5)
        assert (bridge.sim.mechanics.true_position(bridge.clock())[1] - before) * way > 1.0


@pytest.mark.parametrize("latitude", [45.0, -35.0])
@pytest.mark.parametrize("side", [-40.0, 40.0])
@pytest.mark.parametrize("version", ["3.01", "4.10", "4.15", "5.24", "5.31"])
async def test_arrow_north_goes_north_on_both_pier_sides_in_every_version(
    version: str, side: float, latitude: float
) -> None:
    """``p`` came with 4.15, its southern letters with 5.25; before it the declination axis tells."""
    mount = "cge" if version < "4.15" else "cgem"
    async with Bridge(mount, version, site=(latitude, 10.0), config={"lowest": -30.0}) as bridge:
        client = bridge.client()
        sidereal = bridge.sim.mechanics.sky.lst(bridge.clock())
        await bridge.controller.perform(op.Goto((sidereal + side) % 360.0, 0.5 * latitude))
        await ready(bridge, client, b":GR#")
        before = bridge.sim.mechanics.true_position(bridge.clock())[1]
        client.send(b":RS#:Mn#")
        await asyncio.sleep(1.5)
        assert bridge.sim.mechanics.true_position(bridge.clock())[1] - before > 1.0


@pytest.mark.parametrize(("arrow", "refused"), [(b":Ms#", True), (b":Mn#", False)])
async def test_arrow_made_of_small_gotos_keeps_a_fork_below_the_upper_limit(arrow: bytes, refused: bool) -> None:
    """Hand controls before 1.6: between the pole and the zenith south is up, whatever the mount."""
    async with Bridge("nexstar-gps", "1.2", config={"highest": 75.0, "site": (45.0, 10.0)}) as bridge:
        client = bridge.client()
        await bridge.controller.perform(op.GotoHorizontal(3.0, 74.0))
        await ready(bridge, client, b":GR#")
        began = altitude(bridge)
        client.send(b":RS#" + arrow)
        low, high = await polled(bridge, client, b":GR#", 2.0)
        assert high <= 75.0
        assert (low >= began - 0.1) is refused
        assert any("Object Above" in note for note in notes(bridge)) is refused
