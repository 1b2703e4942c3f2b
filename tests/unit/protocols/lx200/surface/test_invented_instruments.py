"""What is not there is not invented: a GPS receiver, a thermometer, high-precision pointing, a sidereal clock."""

from __future__ import annotations

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoDevice
from tests.support.each import each
from tests.support.fake_mount import Talk
from tests.support.in_process_gateway import Bridge

MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]


def test_gps_sentence_without_a_receiver_reports_no_fix() -> None:
    """The status is the third field of RMC: A a fix, V none."""
    talk = Talk(model="lx200gps")
    assert talk.send(b":gps#").split(b",")[2] == b"V"
    assert talk.send(b":gT#") in (b"0", b"1")
    talk.mount.faults[op.GetGps] = NoDevice()
    assert talk.send(b":gps#").split(b",")[2] == b"V"


@pytest.mark.parametrize(("mount", "status"), [("6-8se", b"V"), ("slt", b"V"), ("cpc", b"A")])
async def test_gps_fix_status_is_that_of_the_mount(mount: str, status: bytes) -> None:
    async with Bridge(mount, surface="lx200gps") as bridge:
        client = bridge.client()
        heard = await client.ask(b":gps#", ending=b"#")
        assert heard.startswith(b"$GPRMC,")
        assert heard.split(b",")[2] == status
        assert await client.ask(b":gT#", ending=b"") == (b"0" if status == b"V" else b"1")


@each("model", MODELS)
def test_temperature_query_without_a_thermometer_reports_none(model: str) -> None:
    assert Talk(model=model).send(b":fT#") == b""


@each("model", MODELS)
def test_high_precision_pointing_is_always_reported_off(model: str) -> None:
    """The reply is the setting after the command: 14 bytes, no #."""
    talk = Talk(model=model)
    assert talk.send(b":P#") == b"LOW  PRECISION"
    assert talk.send(b":P#:P#") == b"LOW  PRECISION" * 2
    assert talk.send(b":GR#") == b"12:34:56#", "the format of positions is another thing"


@each("model", MODELS)
def test_reported_sidereal_time_follows_clock_and_site(model: str) -> None:
    talk = Talk(model=model)
    told = talk.send(b":GS#")
    assert talk.send(b":SS12:00:00#") == b"0"
    assert talk.send(b":GS#") == told
    talk.reconnect()
    assert talk.send(b":GS#") == told


async def test_thermometer_and_gps_of_a_real_telescope_are_passed_through() -> None:
    """An LX200GPS behind the gateway has a thermometer and a receiver of its own."""
    async with Bridge("lx200gps", driven="lx200", surface="lx200gps") as bridge:
        client = bridge.client()
        assert await client.ask(b":fT#", ending=b"#") == b"+12.500#"
        assert (await client.ask(b":gps#", 20.0, ending=b"#")).split(b",")[2] == b"A"
