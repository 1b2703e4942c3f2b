"""A NexStar command that was interrupted: its end, when it arrives late, is ignored; a new command is not."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gateway.protocols.nexstar.framing import NexStarFramer
from tests.support.each import each
from tests.support.examples import some

RELEASE = b"P\x02\x10$\0\0\0\0"
RELEASES = [bytes((80, 2, axis, way, 0, 0, 0, 0)) for axis in (16, 17) for way in (36, 37)] + [
    bytes((80, 3, axis, way, 0, 0, 0, 0)) for axis in (16, 17) for way in (6, 7)
]
#: What arrived, and its end, typed by hand.
CUT = [
    (b"r34A", b"B0500,12CE0500"),
    (b"r34AB", b"0500,12CE0500"),
    (b"r34AB0500,", b"E2CE05e0"),
    (b"R34AB,1", b"2CE"),
    (b"b12AB0500,4000", b"EEEE"),
    (b"s34AB0500,12CE05", b"ee"),
    (b"W", b"T\0T\0T\0T\0"),
    (b"W\x21\x32\x29\0\x76", b"T\0\0"),
    (b"H\x0f\x1a\0\x04\x06\x05", b"T\0"),
    (b"K", b"x"),
    (b"P\x02\x10", b"T\0\0\0\0"),
    (b"T", b"\0"),
]


def after(half: bytes, *arrivals: tuple[float, bytes], quiet: float = 0.2) -> list[bytes]:
    """What is carried out: half a command at 0 s, these bytes at these times, and then a quiet line."""
    framer = NexStarFramer()
    assert framer.feed(half, 0.0) == []
    frames = [frame for at, data in arrivals for frame in framer.feed(data, at)]
    return frames + framer.feed(b"", arrivals[-1][0] + quiet)


def spelled(data: bytes, at: float, apart: float = 0.05) -> list[tuple[float, bytes]]:
    return [(at + apart * place, data[place : place + 1]) for place in range(len(data))]


@each("case", CUT)
def test_late_end_of_an_interrupted_nexstar_command_is_ignored(case: tuple[bytes, bytes]) -> None:
    half, end = case
    for gap in (1.0, 1.1, 1.3, 3.2, 3.9):
        assert after(half, (gap, end)) == []
        assert after(half, *spelled(end, gap)) == []
        assert after(half, (gap, end), (gap + 0.3, b"e")) == [b"e"]
        assert after(half, (gap, end + b"e")) == [b"e"]
    assert NexStarFramer().feed(half + end, 0.0) == [half + end]
    framer = NexStarFramer()
    assert framer.feed(half, 0.0) + framer.feed(end, 0.95) == [half + end]


def test_bytes_long_after_an_interrupted_nexstar_command_are_a_new_command() -> None:
    assert after(b"K", (4.1, b"x")) == [b"x"]
    assert after(b"r34A", (4.1, b"B0500,12CE")) == [b"B0500,12CE"]


def test_bytes_of_another_length_after_an_interruption_are_a_new_command() -> None:
    for half in (b"r34A", b"W", b"P\x02", b"T", b"K"):
        for command in (b"r35555555,20000000", b"P\x02\x11$\x09\0\0\0", b"V", b"T\x02", b"E"):
            missing = {b"r": 18, b"W": 9, b"P": 8, b"T": 2, b"K": 2}[half[:1]] - len(half)
            if len(command) != missing:
                assert after(half, (1.5, command)) == [command]
                assert after(half, *spelled(command, 1.5)) == [command]
    assert after(b"r34A", (2.0, b"B0500,12CE")) == [b"B0500,12CE"]
    assert after(b"r34A", (2.0, b"e"), (2.5, b"Z")) == [b"e", b"Z"]
    assert after(b"K", (1.5, RELEASE + b"e")) == [RELEASE, b"e"]


def test_late_rest_of_an_interrupted_nexstar_command_is_ignored_in_parts_too() -> None:
    assert after(b"r34A", (1.5, b"B05"), (1.8, b"00,12CE0500")) == []
    assert after(b"r34A", (1.5, b"B0500,12C"), (1.8, b"E0500")) == []


def test_byte_that_cannot_end_the_interrupted_command_begins_a_new_one() -> None:
    framer = NexStarFramer()
    framer.feed(b"r3555", 0.0)
    assert framer.feed(b"Kz", 2.0) == [b"Kz"]


@each("release", RELEASES)
def test_key_release_after_an_interrupted_nexstar_command_is_carried_out_at_once(release: bytes) -> None:
    start = release[:4] + b"\x05\0\0\0"
    for length in range(1, 8):
        for gap in (1.1, 2.0):
            framer = NexStarFramer()
            framer.feed(start[:length], 0.0)
            assert framer.feed(release, gap) == [release]
            assert framer.feed(b"", gap + 0.2) == []
        for apart in (0.02, 0.15)[: 2 if length < 7 else 1]:  # a single byte is the end of what lacked one
            assert after(start[:length], *spelled(release, 1.1, apart)) == [release]
    for half in (b"K", b"W", b"r34AB0500,", b"H"):
        assert after(half, (1.2, release)) == [release]


def test_cancel_after_an_interrupted_nexstar_command_is_carried_out() -> None:
    for half in (b"K", b"T", b"P\x02", b"W", b"r34A", b"r34AB0500,12CE05"):
        framer = NexStarFramer()
        framer.feed(half, 0.0)
        assert framer.feed(b"M", 1.5) == [b"M"]
        assert framer.feed(b"", 1.7) == []
    assert after(b"H", (1.2, b"M" * 8)) == [b"M"] * 8
    assert after(b"r34A", (1.2, b"B0500,12CE0500M")) == [b"M"]


def test_ambiguous_bytes_after_an_interruption_move_nothing() -> None:
    assert after(b"r34A", (1.2, b"B0500,12CE0500" + b"0B0500,12CE")) == []
    assert after(b"K", (1.2, b"x0"), (1.5, b"E")) == [b"E"]


@some
@given(st.binary(min_size=1, max_size=8), st.lists(st.tuples(st.floats(0, 5), st.binary(max_size=20)), max_size=12))
def test_interrupted_nexstar_commands_pile_up_no_bytes(half: bytes, arrivals: list[tuple[float, bytes]]) -> None:
    framer, now = NexStarFramer(), 0.0
    framer.feed(half, now)
    for wait, data in arrivals:
        now += wait
        framer.feed(data, now)
        assert len(framer._pending) < 18
        if framer.holds_bytes:
            framer.feed(b"", now + 0.2)
            assert not framer.holds_bytes
            now += 0.2
