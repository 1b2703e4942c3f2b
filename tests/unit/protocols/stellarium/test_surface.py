"""The Stellarium surface over a whole gateway: positions without being asked, gotos, and how a refusal shows."""

from __future__ import annotations

import asyncio
import struct
from typing import Any, NamedTuple

import pytest

from gateway.clients.access import AccessRules
from gateway.clients.strangers import ReceivedBytes, StrangerFilter
from gateway.diagnostics.rehearsal.stage import RehearsalClient, RehearsalGateway
from gateway.protocols.registry import PROTOCOLS
from tests.support import exact_sky

START = 1769634000.0
#: The Crab nebula, and what is below the horizon at the place of a simulated mount; J2000.
CRAB, BELOW = (83.633, 22.0145), (83.633, -80.0)


class Position(NamedTuple):
    """A message as a program takes it apart."""

    length: int
    kind: int
    time: float
    ra: float
    dec: float
    status: int


def goto(ra: float, dec: float) -> bytes:
    return struct.pack("<HHQIi", 20, 0, 0, round(ra / 360 * 2**32), round(dec / 360 * 2**32))


def heard(program: RehearsalClient) -> list[Position]:
    """What a program was told since it was asked last."""
    data, program.received = program.received, b""
    assert len(data) % 24 == 0
    rows = [struct.unpack("<HHQIii", data[start : start + 24]) for start in range(0, len(data), 24)]
    return [
        Position(length, kind, time / 1e6, ra * 360 / 2**32, dec * 360 / 2**32, status)
        for length, kind, time, ra, dec, status in rows
    ]


def stage(
    mount: str = "6-8se", driven: str = "nexstar", access: AccessRules = AccessRules(), **others: Any
) -> RehearsalGateway:
    return RehearsalGateway(
        mount, start=START, driven=driven, presented="stellarium", named=True, access=access, **others
    )


@pytest.mark.parametrize(("mount", "driven"), [("6-8se", "nexstar"), ("lx200gps", "lx200"), ("lx200", "lx200")])
async def test_stellarium_reads_its_target_position_after_a_goto(mount: str, driven: str) -> None:
    async with stage(mount, driven) as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        await asyncio.sleep(2.1)
        told = heard(client)
        assert len(told) == 4, "none in the first moment, when it may turn out to be a web browser"
        assert {(one.length, one.kind, one.status) for one in told} == {(24, 0, 0)}
        assert [round(one.time - START, 1) for one in told][-1] > 1.0
        client.send(goto(*CRAB))
        await asyncio.sleep(1.0)
        assert own.sim.slewing
        for _ in range(180):
            if not own.sim.slewing:
                break
            await asyncio.sleep(1.0)
        await asyncio.sleep(1.0)
        last = heard(client)[-1]
        assert abs(last.ra - CRAB[0]) < 0.03 and abs(last.dec - CRAB[1]) < 0.03, last
        assert last.status == 0
        client.close()


async def test_stellarium_status_shows_a_refused_goto_until_one_is_accepted() -> None:
    async with stage() as own:
        client, other = own.client(), own.client("192.0.2.7")
        client.send(goto(*BELOW))
        await asyncio.sleep(1.5)
        assert not own.sim.slewing
        assert heard(client)[-1].status == -1
        assert heard(other)[-1].status == 0, "another program has asked for nothing"
        client.send(goto(*CRAB))
        await asyncio.sleep(1.5)
        assert own.sim.slewing and heard(client)[-1].status == 0


@pytest.mark.parametrize("dec", [0x40000001, -0x40000001])
async def test_stellarium_goto_beyond_a_pole_is_refused(dec: int) -> None:
    async with stage() as own:
        client = own.client()
        client.send(struct.pack("<HHQIi", 20, 0, 0, 0, dec))
        await asyncio.sleep(1.5)
        assert not own.sim.slewing and heard(client)[-1].status == -1


async def test_read_only_stellarium_client_is_refused_a_goto() -> None:
    async with stage(access=AccessRules(read_only=True)) as own:
        client = own.client()
        client.send(goto(*CRAB))
        await asyncio.sleep(1.5)
        assert not own.sim.slewing and heard(client)[-1].status == -1


async def test_dead_man_switch_does_not_stop_a_stellarium_goto() -> None:
    """A program of this protocol says nothing after its goto."""
    async with stage(config={"dead_man": 2.0, "dead_man_closed": 1.0}) as own:
        client, other = own.client(), own.client("192.0.2.7")
        client.send(goto(*CRAB))
        await asyncio.sleep(4.0)
        assert own.sim.slewing and heard(other)[-1].status == 0
        client.close()
        await asyncio.sleep(2.0)
        assert own.sim.slewing


async def test_stellarium_coordinates_are_j2000() -> None:
    """The mount counts of date, 0.36 degrees further in right ascension at this place by then."""
    async with stage() as own:
        exact_sky.load(own.controller.astrometry.sky)
        client = own.client()
        client.send(goto(*CRAB))
        await asyncio.sleep(2.0)
        sent = [data for data in own.sent_requests() if data[:1] == b"r"][-1]
        ra = int(sent[1:9], 16) * 360 / 2**32
        assert 0.3 < ra - CRAB[0] < 0.5
        client.close()


def test_stellarium_client_on_a_port_of_another_protocol_is_recognised() -> None:
    for name, spec in PROTOCOLS.items():
        beginning = StrangerFilter(spec.opening_pattern, name)
        pieces = beginning.feed(ReceivedBytes(goto(*CRAB), 0.0, 0))
        if name == "stellarium":
            assert beginning.stranger is None and b"".join(piece.data for piece in pieces) == goto(*CRAB)
        else:
            assert beginning.stranger is not None and not pieces
            assert "--surface stellarium@tcp://HOST:10001" in beginning.stranger.description
