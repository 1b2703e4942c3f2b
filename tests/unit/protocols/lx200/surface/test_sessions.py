"""What one connection leaves to the next from the same host, through the product's own acceptor."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from gateway.diagnostics.virtual_time import run
from tests.support.fake_gateway import FakeGateway
from tests.support.fake_mount import unix

SETTINGS = b":Sr05:34:32#:Sd+22*00:52#:RS#:U#:So20#:H#"
TOLD = b":GR#:Gr#:Gd#:Go#:Gc#"
KEPT = b"12:34.9#05:34.5#+22*01#20*#12#"
FRESH = b"12:34:56#00:00:00#+00*00:00#00*#24#"


def gateway(test: Callable[[FakeGateway], Awaitable[None]]) -> Callable[[], None]:
    """A test that gets a fresh gateway, on virtual time."""

    def wrapped() -> None:
        async def begun() -> None:
            await test(FakeGateway())

        run(begun())

    wrapped.__name__, wrapped.__doc__ = test.__name__, test.__doc__
    return wrapped


@gateway
async def test_next_connection_of_a_host_continues_the_lx200_session(gateway: FakeGateway) -> None:
    first = gateway.connect()
    assert await first.ask(SETTINGS) == b"111"
    first.close()
    await asyncio.sleep(59)
    second = gateway.connect()
    assert await second.ask(TOLD) == KEPT
    assert await second.ask(b":Mn#:MS#") == b"0"
    assert gateway.mount.of(op.Move)[0].rate == op.Rate(name="max")


@gateway
async def test_lx200_session_is_forgotten_after_a_minute(gateway: FakeGateway) -> None:
    first = gateway.connect()
    await first.ask(SETTINGS)
    first.close()
    await asyncio.sleep(61)
    assert await gateway.connect().ask(TOLD) == FRESH


@gateway
async def test_lx200_session_is_not_continued_by_another_host(gateway: FakeGateway) -> None:
    first = gateway.connect("192.168.4.2")
    await first.ask(SETTINGS)
    first.close()
    assert await gateway.connect("192.168.4.3").ask(TOLD) == FRESH
    assert await gateway.connect("192.168.4.2").ask(TOLD) == KEPT


@gateway
async def test_open_connection_hands_its_lx200_session_to_nobody(gateway: FakeGateway) -> None:
    first = gateway.connect()
    await first.ask(SETTINGS)
    second = gateway.connect()
    assert await second.ask(TOLD) == FRESH
    assert await second.ask(b":U#:U#:Sr10:00:00#:Gr#") == b"110:00:00#"
    assert await first.ask(TOLD) == KEPT


@gateway
async def test_change_in_a_continued_lx200_session_is_kept(gateway: FakeGateway) -> None:
    first = gateway.connect()
    await first.ask(SETTINGS)
    first.close()
    second = gateway.connect()
    assert await second.ask(b":U#:Sr10:00:00#:Gr#") == b"110:00:00#"
    second.close()
    assert await gateway.connect().ask(b":Gr#:Gd#") == b"10:00:00#+22*00:52#", "what the second made of it"


@gateway
async def test_new_connection_continues_the_lx200_session_that_closed_last(gateway: FakeGateway) -> None:
    first, second = gateway.connect(), gateway.connect()
    await first.ask(b":Sr01:00:00#")
    await second.ask(b":Sr02:00:00#")
    second.close()
    await asyncio.sleep(1)
    first.close()
    assert await gateway.connect().ask(b":Gr#") == b"01:00:00#"


@gateway
async def test_overlapping_connections_continue_the_lx200_session(gateway: FakeGateway) -> None:
    """A program that opens the next connection before it has closed the one before loses no target."""
    first = gateway.connect()
    await first.ask(b":Sr05:34:32#")
    first.close()
    poll, second = gateway.connect(), gateway.connect()
    assert await poll.ask(b":U#:GR#") == b"12:34.9#"
    assert await second.ask(b":Sd+22*00:52#:GR#") == b"112:34:56#", "each has a copy of its own"
    poll.close()
    second.close()
    assert await gateway.connect().ask(b":MS#") == b"0"


@gateway
async def test_refused_half_of_a_target_stays_refused_in_the_next_connection(gateway: FakeGateway) -> None:
    heard = b""
    for frame in (b":Sr05:34:32#", b":Sd+22*00:52#", b":Sd+99*00:00#", b":MS#"):
        connection = gateway.connect()
        heard += await connection.ask(frame)
        connection.close()
    assert heard == b"1101No target set.#"


# --- the clock over several connections ---------------------------------------------------------------------------


@gateway
async def test_clock_set_over_three_connections_makes_one_instant(gateway: FakeGateway) -> None:
    for frame in (b":SG+05#", b":SL21:30:00#", b":SC07/04/26#"):
        connection = gateway.connect()
        await connection.ask(frame)
        connection.close()
        assert len(gateway.mount.of(op.SetClock)) == (frame == b":SC07/04/26#")
    await asyncio.sleep(10)
    (clock,) = gateway.mount.of(op.SetClock)
    assert clock.unix == pytest.approx(unix("2026-07-05 02:30:00"), abs=0.05)
    assert clock.offset == -5.0


@gateway
async def test_lx200_date_and_time_of_a_closed_connection_set_the_clock_after_a_pause(gateway: FakeGateway) -> None:
    connection = gateway.connect()
    await connection.ask(b":SC07/04/26#:SL21:30:00#")
    connection.close()
    await asyncio.sleep(1.8)
    assert gateway.mount.of(op.SetClock) == []
    await asyncio.sleep(0.4)
    (clock,) = gateway.mount.of(op.SetClock)
    assert clock.unix == pytest.approx(unix("2026-07-05 05:30:02"), abs=0.05)


@gateway
async def test_lx200_date_and_time_are_set_on_a_mount_that_reports_no_time(gateway: FakeGateway) -> None:
    perform = gateway.mount.perform

    def timeless(operation: op.Operation) -> object:
        if isinstance(operation, op.GetClock):
            raise NoAnswer
        return perform(operation)

    gateway.mount.perform = timeless  # type: ignore[method-assign]
    await gateway.connect().ask(b":SC07/04/26#:SL21:30:00#")
    await asyncio.sleep(3)
    assert len(gateway.mount.of(op.SetClock)) == 1


# --- repeated questions -------------------------------------------------------------------------------------------


@gateway
async def test_repeated_lx200_query_shows_a_changed_position_or_precision(gateway: FakeGateway) -> None:
    connection = gateway.connect()
    assert [await connection.ask(b":GR#") for _ in range(3)] == [b"12:34:56#"] * 3
    assert await connection.ask(b":U#") + await connection.ask(b":GR#") == b"12:34.9#"
    gateway.mount.position = op.Equatorial(15.0, 0.0)
    gateway.controller.changed()
    assert await connection.ask(b":GR#") == b"01:00.0#"
    other = gateway.connect()
    assert await other.ask(b":GR#") == b"01:00:00#"


@gateway
async def test_position_pair_is_of_one_instant_however_often_queried(gateway: FakeGateway) -> None:
    connection = gateway.connect()
    for degrees in range(10, 40):
        gateway.mount.position = op.Equatorial(degrees * 15.0 / 2, degrees / 2)
        gateway.controller.changed()
        if degrees % 3 == 0:
            await connection.ask(b":GD#")
        hours = [await connection.ask(b":GR#") for _ in range(degrees % 3 + 1)][-1]
        gateway.mount.position = op.Equatorial((degrees + 1) * 15.0 / 2, (degrees + 1) / 2)
        gateway.controller.changed()
        dec = await connection.ask(b":GD#")
        assert int(hours[:2]) == int(dec[1:3]) == degrees // 2
        await asyncio.sleep(0.3)
