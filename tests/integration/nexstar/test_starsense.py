"""A StarSense hand control, which counts its versions anew from 1.18: simulated, driven, presented.

The bytes were typed by hand from what programs that drive one expect of it: ``v`` is 13 (hexadecimal), 1.20 tells its
version behind the mode of ``t``, and site and time set on an aligned one cost the alignment.
"""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.app.config import parse_endpoint
from gateway.core.errors import UserError
from gateway.core.operations import ClockFromGps, GetSite, GetStatus, SetClock, SetSite
from tests.support.fake_mount import Talk
from tests.support.in_process_gateway import Bridge
from tests.unit.protocols.nexstar.simulator.test_simulator import Bench

WEST_OF_PARIS = b"W\x30\x32\x29\x00\x02\x14\x11\x00"
ANY_TIME = b"H\x0f\x1a\x00\x04\x06\x1a\x00\x00"


# --- its name ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("typed", "model", "version", "shown"),
    [
        ("nexstar:starsense@sim", None, "starsense-1.20", "nexstar:starsense/1.20@sim"),
        ("nexstar:starsense/1.19@sim", None, "starsense-1.19", "nexstar:starsense/1.19@sim"),
        ("nexstar:avx/starsense@sim", "avx", "starsense-1.20", "nexstar:avx/starsense-1.20@sim"),
        ("nexstar:cpc/starsense-1.18@sim", "cpc", "starsense-1.18", "nexstar:cpc/starsense-1.18@sim"),
    ],
)
def test_starsense_names_itself_by_model_and_version(typed: str, model: str | None, version: str, shown: str) -> None:
    endpoint = parse_endpoint(typed)
    assert (endpoint.model, endpoint.version) == (model, version)
    assert str(endpoint) == shown
    assert parse_endpoint(shown) == endpoint


@pytest.mark.parametrize(
    "typed",
    [
        "nexstar:starsense/4.21@sim",
        "nexstar:avx/starsense-1.17@sim",
        "nexstar:avx/starsense-x@sim",
        "nexstar:avx/starsens@sim",
        "lx200:starsense@sim",
        "nexstar:avx/starsense-2.0@sim",
    ],
)
def test_starsense_model_refuses_versions_that_never_existed(typed: str) -> None:
    with pytest.raises(UserError):
        parse_endpoint(typed)


# --- simulated --------------------------------------------------------------------------------------------------------


def test_only_starsense_1_20_appends_its_version_to_the_tracking_mode() -> None:
    assert Bench("avx", "starsense-1.20")(b"t") == b"\x02\x01\x14#"
    assert Bench("avx", "starsense-1.19")(b"t") == b"\x02#"
    assert Bench("avx", "4.21")(b"t") == b"\x02#"


def test_starsense_lacks_the_commands_of_nexstar_versions_above_its_number() -> None:
    """It has neither the quarters of an hour of 5.28 nor the undoing of syncs of 5.29, but the side of the pier."""
    bench = Bench("avx", "starsense-1.20")
    assert bench(b"i") == b"" and bench(b"u") == b""
    assert bench(b"p") in (b"E#", b"W#")


# --- driven -----------------------------------------------------------------------------------------------------------


def told(bridge: Bridge) -> list[bytes]:
    """What was said of site and time, and whether it was asked for its alignment."""
    return [sent[:1] for sent in bridge.sent_requests() if sent[:1] in (b"W", b"H", b"I", b"J")]


async def test_aligned_starsense_is_never_sent_site_or_time() -> None:
    async with Bridge("cpc", "starsense-1.20", config={"site_time": "always"}) as bridge:
        assert bridge.driver.starsense
        await bridge.controller.perform(SetSite(48.0, 2.0))
        await bridge.controller.perform(SetClock(bridge.clock() + 100.0, 1.0))
        await bridge.controller.perform(ClockFromGps())
        await asyncio.sleep(30.0)
        assert b"W" not in told(bridge) and b"H" not in told(bridge)
        assert bridge.sim.aligned
        assert (await bridge.controller.answer(GetSite())).latitude == pytest.approx(48.0)
        said = [entry.note for entry in bridge.entries if "stored in the gateway" in entry.note]
        assert len(said) == 3


async def test_starsense_alignment_is_read_before_site_or_time_is_sent() -> None:
    """Somebody may have aligned it at the keypad since anybody looked."""
    async with Bridge("cpc", "starsense-1.20", aligned=False) as bridge:
        assert not (await bridge.controller.read(GetStatus())).aligned
        await bridge.controller.perform(SetSite(48.0, 2.0))
        await bridge.controller.perform(SetClock(bridge.clock() + 100.0, 1.0))
        await asyncio.sleep(10.0)
        heard = b"".join(told(bridge))
        assert b"JW" in heard and b"JH" in heard
        assert bridge.sim.mechanics.sky.latitude == pytest.approx(48.0)
        # it was aligned a moment ago, and the gateway has not seen it
        before = len(told(bridge))
        aligned = bridge.controller.driver.perform(SetSite(45.0, 10.0))
        bridge.sim.aligned = True
        with pytest.raises(Exception, match="alignment"):
            await bridge.controller.reader._runner.drive(aligned, 1)
        assert set(told(bridge)[before:]) == {b"J"}
        assert bridge.sim.aligned


@pytest.mark.parametrize("version", ["1.18", "1.19", "1.20"])
async def test_starsense_tracking_mode_is_read_whatever_bytes_follow_it(version: str) -> None:
    async with Bridge("avx", f"starsense-{version}", presented="nexstar", surface="avx") as bridge:
        client = bridge.client()
        for mode in (b"\x00", b"\x02"):
            assert await client.ask(b"T" + mode) == b"#"
            assert await client.ask(b"t") == mode + b"#"
        assert bridge.driver.version_text == version
        assert await client.ask(b":", 0.1) == b""


def test_configured_starsense_is_driven_as_one_before_its_first_answer() -> None:
    from gateway.protocols.base.spec import DriverSettings
    from gateway.protocols.nexstar.driver.state import NexStar

    mount = NexStar(lambda: 0.0, DriverSettings("avx", "starsense-1.20"))
    assert mount.starsense and mount.supports("e") and mount.supports("s") and not mount.supports("i")
    assert mount.equinox == "jnow"
    assert not NexStar(lambda: 0.0, DriverSettings("gt", "101.0")).supports("e")  # it counts as a 1.2


# --- presented --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "minor", "behind"), [("1.18", 18, b""), ("1.19", 19, b""), ("1.20", 20, b"\x01\x14")]
)
def test_presented_starsense_answers_as_a_real_one(version: str, minor: int, behind: bytes) -> None:
    talk = Talk(protocol="nexstar", model="avx", version=f"starsense-{version}")
    assert talk.send(b"V") == bytes((1, minor)) + b"#"
    assert talk.send(b"v") == b"\x13#"
    assert talk.send(b"m") == b"\x14#"
    assert talk.send(b"t") == b"\x02" + behind + b"#"
    assert talk.send(b"J") == b"\x01#"
    assert len(talk.send(b"e")) == 18 and len(talk.send(b"h")) == 9 and len(talk.send(b"p")) == 2
    assert talk.send(b"i") == b"" and talk.send(b"u") == b""
    assert talk.send(b"P\x01\x10\xfe\0\0\0\x02") == b"\x06\x10#"


def test_presented_nexstar_does_not_answer_as_a_starsense() -> None:
    talk = Talk(protocol="nexstar", model="avx", version="4.21")
    assert talk.send(b"v") == b"\x11#" and talk.send(b"t") == b"\x02#"


@pytest.mark.parametrize(("mount", "number"), [("lx200gps", 12), ("lx200", 12)])
async def test_starsense_surface_without_a_model_presents_one_that_fits_the_mount(mount: str, number: int) -> None:
    settings: dict[str, Any] = {"driven": "lx200", "presented": "nexstar", "surface": None}
    async with Bridge(mount, surface_version="starsense-1.20", **settings) as bridge:
        client = bridge.client()
        assert await client.ask(b"V") == b"\x01\x14#"
        assert await client.ask(b"m") == bytes((number,)) + b"#"
        assert (await client.ask(b"r34AB0500,12CE0500")) == b"#"
        assert await client.ask(b"M") == b"#"


async def test_site_set_through_a_starsense_surface_keeps_the_alignment() -> None:
    """A mount behind the gateway that keeps its alignment keeps it."""
    async with Bridge(
        "lx200gps", driven="lx200", presented="nexstar", surface="cpc", surface_version="starsense-1.20"
    ) as bridge:
        client = bridge.client()
        assert await client.ask(WEST_OF_PARIS) == b"#"
        assert await client.ask(ANY_TIME) == b"#"
        assert await client.ask(b"J") == b"\x01#"
        assert await client.ask(b"w") == WEST_OF_PARIS[1:] + b"#"
