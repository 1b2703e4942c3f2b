"""Sky-Watcher's SynScan, driven and presented: its name, its equinox, its stops, its park position.

What it sends and answers byte by byte: ``tests/conformance/test_manual_synscan.py``.
"""

from __future__ import annotations

import asyncio

import pytest

from gateway.app.config.endpoints import parse_device
from gateway.app.config.keys import SurfaceConfig
from gateway.app.config.programs import with_needs
from gateway.astro.spherical import fold_declination, separation
from gateway.core import operations as op
from gateway.core.errors import Refused
from gateway.protocols.nexstar.driver.state import NexStar
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.manual_files import rows

RIGEL_2000 = (78.634467, -8.201639)


def test_synscan_driver_sends_the_documented_bytes() -> None:
    assert str(parse_device("nexstar:synscan/4.39.05", "/dev/ttyUSB0")) == "nexstar:synscan/4.39.05@/dev/ttyUSB0"
    for name in ("synscan", "EQ6", "HEQ5 Pro", "Sky-Watcher NEQ6"):
        assert parse_device(name).model == "synscan", name
    for name in ("AZ-GTi", "AllView"):
        assert parse_device(name).model == "synscan-az", name


@each("number, called, model", rows("synscan_models.txt"))
def test_synscan_driver_takes_the_model_from_the_model_code(number: str, called: str, model: str) -> None:
    mount = NexStar(lambda: 0.0)
    mount.dialect = "synscan"
    assert mount.model_by_number(int(number)) == model
    mount.dialect = None
    assert mount.model_by_number(5) == "cge"
    assert mount.model_by_number(26) == "skywatcher"


@pytest.mark.parametrize("model", ["synscan", "synscan-az"])
async def test_synscan_is_detected_without_being_named(model: str) -> None:
    async with Bridge(model) as bridge:
        identity = await bridge.controller.answer(op.GetIdentity())
        assert (identity.product, identity.version, identity.model) == ("Sky-Watcher SynScan", "4.39.05", model)
        assert bridge.controller.driver.german is (model == "synscan")


async def test_az_eq_mount_is_taken_for_the_type_in_which_it_tracks() -> None:
    async with Bridge("synscan-az") as bridge:
        bridge.sim.facts = {**bridge.sim.facts, "id": 5}
        await bridge.controller.read_now(op.GetIdentity())
        assert bridge.controller.driver.model == "synscan-az"


@pytest.mark.parametrize("mode", [None, "alt-az", "eq-north"])
async def test_az_eq_mount_that_has_not_tracked_yet_is_refused_type_specific_orders(mode: str | None) -> None:
    bridge = Bridge("synscan-az", config={"mode": mode})
    bridge.sim.facts = {**bridge.sim.facts, "id": 5}
    bridge.sim.feed(b"T\0")
    async with bridge:
        await bridge.controller.answer(op.GetIdentity())
        driver, here = bridge.controller.driver, await bridge.controller.answer(op.Position())
        assert driver.german is (mode != "alt-az")
        orders = (op.Goto(here.ra, 20.0), op.Park(), op.SetTracking(on=True), op.GotoAxes(10.0, 40.0))
        for order in orders if mode is None else ():
            with pytest.raises(Refused, match="turn tracking on once"):
                await bridge.controller.perform(order)
        if mode is None:
            assert not {b"T\1", b"T\2"} & set(bridge.sent_requests())
            bridge.sim.feed(b"T\1")
            await bridge.controller.read_now(op.GetStatus())
            assert driver.model == "synscan-az"
            await bridge.controller.perform(op.SetTracking(on=False))
        await bridge.controller.perform(op.SetTracking(on=True))
        assert b"T\2" in bridge.sent_requests() if mode == "eq-north" else b"T\1" in bridge.sent_requests()


@pytest.mark.parametrize("model", ["synscan", "synscan-az"])
async def test_synscan_coordinates_are_j2000(model: str) -> None:
    """By the simulator's mechanics, which know nothing of equinoxes: 22 arcminutes apart in 2026."""
    async with Bridge(model) as bridge:
        date = await bridge.controller.answer(op.ToEquinoxOfDate(*RIGEL_2000))
        assert separation(date.ra, date.dec, *RIGEL_2000) > 0.3
        await bridge.controller.perform(op.Goto(date.ra, date.dec))
        await asyncio.sleep(90.0)
        bridge.sim.true_position()
        assert separation(*bridge.sim.mechanics.believed_position(bridge.sim.now), date.ra, date.dec) * 3600.0 < 10.0
        seen = await bridge.controller.answer(op.Position())
        assert separation(seen.ra, seen.dec, date.ra, date.dec) * 3600.0 < 10.0


async def test_synscan_beyond_the_pole_reports_where_the_tube_points() -> None:
    async with Bridge("synscan") as bridge:
        bridge.sim.mechanics.move(bridge.clock(), 2, 4.0)
        await asyncio.sleep(3.0)
        bridge.sim.mechanics.move(bridge.clock(), 2, 0.0)
        await asyncio.sleep(2.0)
        seen, (ra, dec) = await bridge.controller.read_now(op.Position()), bridge.sim.true_position()
        assert bridge.sim.mechanics.axes(bridge.clock())[1] > 95.0
        assert separation(seen.ra, seen.dec, *fold_declination(ra, dec)) * 3600.0 < 60.0


@pytest.mark.parametrize(("mount", "presented"), [("cge", "synscan"), ("6-8se", "synscan-az")])
async def test_synscan_programs_get_j2000_coordinates_and_a_fitting_model(mount: str, presented: str) -> None:
    async with Bridge(mount, presented="nexstar", surface="synscan") as bridge:
        await bridge.gateway.present_fitting_model()
        client = bridge.client()
        assert await client.ask(b"V") == b"042705#"
        assert await client.ask(b"m") == (b"\0#" if presented == "synscan" else b"\x80#")
        ra, dec = await client.ask(b"e"), await bridge.controller.answer(op.Position())
        told = [int(part, 16) * 360.0 / 2**32 for part in ra[:-1].split(b",")]
        wanted = await bridge.controller.answer(op.ToJ2000(dec.ra, dec.dec))
        assert separation(told[0], told[1], wanted.ra, wanted.dec) * 3600.0 < 20.0


def test_client_profile_does_not_override_the_equinox_of_the_model() -> None:
    """INDI takes every hand control of Celestron as of date, and a SynScan as of 2000."""
    assert with_needs(SurfaceConfig(at="nexstar:synscan@tcp://127.0.0.1:0", client="indi")).equinox is None
    assert with_needs(SurfaceConfig(at="nexstar:cge@tcp://127.0.0.1:0", client="indi")).equinox == "jnow"


@pytest.mark.parametrize("order", [op.AbortSlew(), op.AbortMotion()])
async def test_synscan_stop_is_m_and_rate_0_on_both_axes(order: op.Operation) -> None:
    async with Bridge("synscan", "3.36") as bridge:
        here = await bridge.controller.answer(op.Position())
        await bridge.controller.perform(op.Goto(here.ra, 20.0))
        await asyncio.sleep(3.0)
        await bridge.controller.perform(order)
        await asyncio.sleep(5.0)
        assert not bridge.sim.slewing
        sent = b"".join(bridge.sent_requests())
        for frame in (b"M", b"P\2\x10\x24\0\0\0\0", b"P\2\x11\x24\0\0\0\0"):
            assert frame in sent


async def test_synscan_parks_at_the_pole_with_its_counterweight_down() -> None:
    async with Bridge("synscan") as bridge:
        here = await bridge.controller.answer(op.Position())
        await bridge.controller.perform(op.Goto(here.ra, 40.0))
        await asyncio.sleep(90.0)
        await bridge.controller.perform(op.Park())
        await asyncio.sleep(90.0)
        assert b"b00000000,40000000" in b"".join(bridge.sent_requests())
        bridge.sim.true_position()
        assert bridge.sim.mechanics.axes(bridge.sim.now) == pytest.approx((90.0, 90.0), abs=0.01)
        assert not bridge.sim.tracking


async def test_synscan_pec_mode_counts_as_tracking() -> None:
    async with Bridge("synscan") as bridge:
        bridge.sim.feed(b"T\3")
        assert (await bridge.controller.read_now(op.GetStatus())).tracking is op.Tracking.EQ_NORTH
    async with Bridge("cge", presented="nexstar", surface="synscan") as bridge:
        client = bridge.client()
        for code, told in ((0, 0), (3, 2), (0, 0), (2, 2)):
            assert await client.ask(bytes((0x54, code))) == b"#"
            await asyncio.sleep(3.0)
            assert await client.ask(b"t") == bytes((told, 0x23)), code
