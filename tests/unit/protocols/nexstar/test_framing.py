"""NexStar requests are framed by length: whole, byte by byte, and with bytes behind them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gateway.protocols.nexstar.framing import NexStarFramer
from tests.support.each import each
from tests.support.examples import some

#: Typed by hand: one request of each length and letter.
REQUESTS = [
    *(letter.encode() for letter in "EeZzVvmJLMtwhixypl"),
    b"K#",
    b"T\x02",
    b"R34AB,12CE",
    b"B12AB,4000",
    b"S34AB,12CE",
    b"r34AB0500,12CE0500",
    b"r355555\0\0,200000\0\0",
    b"b12AB0500,40000500",
    b"s34AB0500,12CE0500",
    b"W\x21\x32\x29\x00\x76\x14\x11\x01",
    b"W####PRKT",
    b"H\x0f\x1a\x00\x04\x06\x05\xfb\x01",
    b"I\x0f\x1a\x00\x04\x06\x05\xec\x01",
    b"P\x02\x11\x24\x09\x00\x00\x00",
    b"P\x03\x10\x06\x23\x23\x00\x00",
]


@each("request_", REQUESTS)
def test_one_request_however_it_comes(request_: bytes) -> None:
    assert NexStarFramer().feed(request_, 0.0) == [request_]
    framer = NexStarFramer()
    pieces = [framer.feed(request_[n : n + 1], n * 0.9) for n in range(len(request_))]
    assert [frame for frames in pieces for frame in frames] == [request_]
    assert NexStarFramer().feed(request_ + b"#\r\n\0 ?" + request_ + b"e", 0.0) == [request_, request_, b"e"]


def test_junk_is_dropped() -> None:
    for byte in b":\x06Aa\x7f\xff01":
        assert NexStarFramer().feed(b"?#\r\n\0 " + bytes((byte,)) + b"E", 0.0) == []
    assert NexStarFramer().feed(b"?E", 0.0) == [b"E"]
    assert NexStarFramer().feed(b"V#t#e#", 0.0) == [b"V", b"t", b"e"]


def test_half_a_command_is_dropped_after_a_quiet_second() -> None:
    framer = NexStarFramer()
    assert framer.feed(b"r3555", 0.0) == []
    assert framer.feed(b"Kz", 2.0) == [b"Kz"]
    assert framer.feed(b"r3555", 10.0) == []
    assert framer.feed(b"5555,20000000", 10.9) == [b"r35555555,20000000"]


@some
@given(st.lists(st.binary(max_size=40), max_size=20))
def test_nothing_piles_up_and_splitting_changes_nothing(chunks: list[bytes]) -> None:
    framer, whole = NexStarFramer(), NexStarFramer()
    frames = [frame for chunk in chunks for frame in framer.feed(chunk, 0.0)]
    assert frames == whole.feed(b"".join(chunks), 0.0)
    assert len(framer._pending) < 18
