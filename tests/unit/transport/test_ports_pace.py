"""Connections that send without end: together they get a bounded share, and what only repeats itself is passed over."""

from __future__ import annotations

import asyncio

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gateway.app.gateway import Gateway
from gateway.protocols.lx200.framing import Framer
from gateway.transport.intake import GAP, LARGE_READ, OTHERS, PAUSE, SHARE, Pace, period, skip_repetitions
from tests.support.each import each
from tests.support.sampling import as_a_rule
from tests.unit.transport.test_ports import address, ask, serve


def test_a_few_wait_for_a_breath_and_a_crowd_for_each_other() -> None:
    pace = Pace()
    assert [pace.pause(10.0, 0.0001) for _ in range(4)] == pytest.approx([PAUSE + GAP * n for n in range(4)])
    assert pace.pause(20.0, 0.0) == pytest.approx(PAUSE)


def test_whose_share_takes_long_costs_the_others_no_more() -> None:
    pace = Pace()
    assert [pace.pause(10.0, 0.01) for _ in range(4)] == pytest.approx([PAUSE + OTHERS * 0.01 * n for n in range(4)])


@settings(max_examples=as_a_rule(40, whole=100))
@given(
    st.lists(st.sampled_from([b":Qn#", b":Qs#", b":Qe#", b":Qw#", b":Q#"]), min_size=1, max_size=9),
    st.integers(0, 40),
    st.integers(1, 2000),
)
@example([b":Qs#", b":Qs#", b":Qn#", b":Qs#", b":Qs#", b":Qs#"], 0, 513)
def test_what_is_left_of_a_repetition_ends_as_all_of_it_does(cycle: list[bytes], begin: int, length: int) -> None:
    """A whole number of cycles is left out: what is framed begins where it would have, and at least one is kept."""
    stream = b"".join(cycle) * 800
    share, more = stream[begin : begin + SHARE], stream[begin + SHARE : begin + SHARE + length]
    kept = skip_repetitions(share, more)
    assert len(kept) <= SHARE
    assert more.endswith(kept)
    whole, part = Framer(), Framer()
    whole.feed(share, 0.0)
    part.feed(share, 0.0)
    heard, shortened = whole.feed(more, 0.0), part.feed(kept, 0.0)
    assert set(heard) == set(shortened)
    assert heard[-1:] == shortened[-1:]
    assert whole.feed(b":GR#", 0.0) == part.feed(b":GR#", 0.0)


@each("more", [b":Mn#" + b":Qn#" * 9, b":Qn#:Mn#" * 20, b":Qn", b"", b"#" * 600])
def test_nothing_is_left_out_of_what_is_no_repetition(more: bytes) -> None:
    assert skip_repetitions(b":Qn#" * 128, more) == more


def test_what_follows_a_repetition_is_kept() -> None:
    assert skip_repetitions(b":Qn#" * 128, b":Qn#" * 900 + b":Mn#:Qn#") == b":Qn#:Mn#:Qn#"
    assert skip_repetitions(b":Qn#" * 128, b":Qn#:Mn#:Qn#") == b":Qn#:Mn#:Qn#"


def test_noise_has_no_period() -> None:
    assert period(bytes(range(256)) * 2) == 256
    assert period(bytes(range(255)) * 2) == 255
    assert period(bytes(range(256)) + bytes(reversed(range(256)))) == 0
    assert period(b":Qn#") in (0, 4)


@pytest.mark.parametrize("last", [b":Mn#", b":Q#:Mn#:Qe#"])
def test_what_follows_a_flood_of_halts_is_heard(last: bytes) -> None:
    """Also what was read together with the last of it."""

    async def program(gateway: Gateway) -> None:
        reader, writer = await asyncio.open_connection(*address(gateway))
        writer.write(b":Qn#" * (LARGE_READ // 2) + last + b":GVP#")
        async with asyncio.timeout(10):
            assert await reader.readuntil(b"#") == b"Autostar#"
            while gateway.controller.wanted.axes != {2}:
                await asyncio.sleep(0.01)
        writer.close()

    serve(program, "lx200@tcp://127.0.0.1:0")


def test_who_floods_with_halts_and_is_gone_leaves_nothing_behind() -> None:
    async def program(gateway: Gateway) -> None:
        other = await asyncio.open_connection(*address(gateway))
        assert await ask(other, b":GVP#")
        port = gateway.ports[0]
        for _ in range(5):
            writer = (await asyncio.open_connection(*address(gateway)))[1]
            writer.write(b":Qn#:Qs#" * 60000)
            writer.close()
        async with asyncio.timeout(5):
            while len(port.connections) > 1:  # type: ignore[attr-defined]
                assert len(await ask(other, b":GR#")) == 9
                await asyncio.sleep(0.05)
        other[1].close()

    serve(program, "lx200@tcp://127.0.0.1:0")
