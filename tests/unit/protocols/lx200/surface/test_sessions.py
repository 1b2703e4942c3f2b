"""What one connection leaves to the next from the same host, through the product's own acceptor."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer
from tests.support.fake_mount import unix
from tests.support.virtual import run
from tests.support.visits import House

SETTINGS = b":Sr05:34:32#:Sd+22*00:52#:RS#:U#:So20#:H#"
TOLD = b":GR#:Gr#:Gd#:Go#:Gc#"
KEPT = b"12:34.9#05:34.5#+22*01#20*#12#"
FRESH = b"12:34:56#00:00:00#+00*00:00#00*#24#"


def house(test: Callable[[House], Awaitable[None]]) -> Callable[[], None]:
    """A test that gets a fresh house, on virtual time."""

    def wrapped() -> None:
        async def begun() -> None:
            await test(House())

        run(begun())

    wrapped.__name__, wrapped.__doc__ = test.__name__, test.__doc__
    return wrapped


@house
async def test_the_next_connection_of_a_host_goes_on_where_the_last_ended(house: House) -> None:
    first = house.visit()
    assert await first.ask(SETTINGS) == b"111"
    first.close()
    await asyncio.sleep(59)
    second = house.visit()
    assert await second.ask(TOLD) == KEPT
    assert await second.ask(b":Mn#:MS#") == b"0"
    assert house.mount.of(op.Move)[0].rate == op.Rate(name="max")


@house
async def test_after_a_minute_nothing_is_left(house: House) -> None:
    first = house.visit()
    await first.ask(SETTINGS)
    first.close()
    await asyncio.sleep(61)
    assert await house.visit().ask(TOLD) == FRESH


@house
async def test_nothing_is_left_to_another_host(house: House) -> None:
    first = house.visit("192.168.4.2")
    await first.ask(SETTINGS)
    first.close()
    assert await house.visit("192.168.4.3").ask(TOLD) == FRESH
    assert await house.visit("192.168.4.2").ask(TOLD) == KEPT


@house
async def test_an_open_connection_leaves_nothing(house: House) -> None:
    first = house.visit()
    await first.ask(SETTINGS)
    second = house.visit()
    assert await second.ask(TOLD) == FRESH
    assert await second.ask(b":U#:U#:Sr10:00:00#:Gr#") == b"110:00:00#"
    assert await first.ask(TOLD) == KEPT


@house
async def test_it_is_a_copy(house: House) -> None:
    first = house.visit()
    await first.ask(SETTINGS)
    first.close()
    second = house.visit()
    assert await second.ask(b":U#:Sr10:00:00#:Gr#") == b"110:00:00#"
    second.close()
    assert await house.visit().ask(b":Gr#:Gd#") == b"10:00:00#+22*00:52#", "what the second made of it"


@house
async def test_the_one_that_closed_last_is_the_one_that_counts(house: House) -> None:
    first, second = house.visit(), house.visit()
    await first.ask(b":Sr01:00:00#")
    await second.ask(b":Sr02:00:00#")
    second.close()
    await asyncio.sleep(1)
    first.close()
    assert await house.visit().ask(b":Gr#") == b"01:00:00#"


@house
async def test_connections_that_overlap_go_on_too(house: House) -> None:
    """A program that opens the next connection before it has closed the one before loses no target."""
    first = house.visit()
    await first.ask(b":Sr05:34:32#")
    first.close()
    poll, second = house.visit(), house.visit()
    assert await poll.ask(b":U#:GR#") == b"12:34.9#"
    assert await second.ask(b":Sd+22*00:52#:GR#") == b"112:34:56#", "each has a copy of its own"
    poll.close()
    second.close()
    assert await house.visit().ask(b":MS#") == b"0"


@house
async def test_a_goto_over_four_connections(house: House) -> None:
    heard = b""
    for frame in (b":Sr05:34:32#", b":Sd+22*00:52#", b":MS#", b":D#"):
        visit = house.visit()
        heard += await visit.ask(frame)
        visit.close()
    assert heard == b"110\x7f#"


@house
async def test_a_refused_half_is_left_to_the_next_as_well(house: House) -> None:
    heard = b""
    for frame in (b":Sr05:34:32#", b":Sd+22*00:52#", b":Sd+99*00:00#", b":MS#"):
        visit = house.visit()
        heard += await visit.ask(frame)
        visit.close()
    assert heard == b"1101No target set.#"


# --- the clock over several connections ---------------------------------------------------------------------------


@house
async def test_three_connections_make_one_instant(house: House) -> None:
    for frame in (b":SG+05#", b":SL21:30:00#", b":SC07/04/26#"):
        visit = house.visit()
        await visit.ask(frame)
        visit.close()
        assert len(house.mount.of(op.SetClock)) == (frame == b":SC07/04/26#")
    await asyncio.sleep(10)
    (clock,) = house.mount.of(op.SetClock)
    assert clock.unix == pytest.approx(unix("2026-07-05 02:30:00"), abs=0.05)
    assert clock.offset == -5.0


@house
async def test_a_closed_connections_pause_ends_all_the_same(house: House) -> None:
    visit = house.visit()
    await visit.ask(b":SC07/04/26#:SL21:30:00#")
    visit.close()
    await asyncio.sleep(1.8)
    assert house.mount.of(op.SetClock) == []
    await asyncio.sleep(0.4)
    (clock,) = house.mount.of(op.SetClock)
    assert clock.unix == pytest.approx(unix("2026-07-05 05:30:02"), abs=0.05)


@house
async def test_a_pause_ends_on_a_mount_that_tells_no_time_too(house: House) -> None:
    perform = house.mount.perform

    def timeless(operation: op.Operation) -> object:
        if isinstance(operation, op.GetClock):
            raise NoAnswer
        return perform(operation)

    house.mount.perform = timeless  # type: ignore[method-assign]
    await house.visit().ask(b":SC07/04/26#:SL21:30:00#")
    await asyncio.sleep(3)
    assert len(house.mount.of(op.SetClock)) == 1


# --- repeated questions -------------------------------------------------------------------------------------------


@house
async def test_a_repeated_question_is_answered_anew_when_anything_has_changed(house: House) -> None:
    visit = house.visit()
    assert [await visit.ask(b":GR#") for _ in range(3)] == [b"12:34:56#"] * 3
    assert await visit.ask(b":U#") + await visit.ask(b":GR#") == b"12:34.9#"
    house.mount.position = op.Equatorial(15.0, 0.0)
    house.controller.changed()
    assert await visit.ask(b":GR#") == b"01:00.0#"
    other = house.visit()
    assert await other.ask(b":GR#") == b"01:00:00#"


@house
async def test_a_pair_is_one_instant_however_often_it_was_asked(house: House) -> None:
    visit = house.visit()
    for degrees in range(10, 40):
        house.mount.position = op.Equatorial(degrees * 15.0 / 2, degrees / 2)
        house.controller.changed()
        if degrees % 3 == 0:
            await visit.ask(b":GD#")
        hours = [await visit.ask(b":GR#") for _ in range(degrees % 3 + 1)][-1]
        house.mount.position = op.Equatorial((degrees + 1) * 15.0 / 2, (degrees + 1) / 2)
        house.controller.changed()
        dec = await visit.ask(b":GD#")
        assert int(hours[:2]) == int(dec[1:3]) == degrees // 2
        await asyncio.sleep(0.3)
