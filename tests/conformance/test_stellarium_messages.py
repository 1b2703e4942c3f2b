"""Messages of Stellarium's telescope protocol, written byte by byte from the program's own guide."""

from __future__ import annotations

import pytest

from gateway.protocols.stellarium.surface import StellariumFramer
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each

COMMANDS = load("stellarium").commands
#: 20 bytes, type 0, 1 000 000 microseconds, 6 h, 45 degrees.
GOTO = bytes.fromhex("1400 0000 40420F0000000000 00000040 00000020")
#: 24 bytes, type 0, the same time, 12 h, -90 degrees, status -1.
POSITION = bytes.fromhex("1800 0000 40420F0000000000 00000080 000000C0 FFFFFFFF")


def test_stellarium_goto_message_becomes_a_goto() -> None:
    found = load("stellarium").find(GOTO)
    assert found is not None and found[0].name == "goto"
    assert found[1].decode(GOTO) == {"time": 1_000_000, "ra": 90.0, "dec": 45.0}
    assert found[1].encode({"time": 1_000_000, "ra": 90.0, "dec": 45.0}) == GOTO


def test_stellarium_position_message_is_written_as_the_guide_says() -> None:
    picture = COMMANDS["position"].replies[0][1]
    values = {"time": 1_000_000, "ra": 180.0, "dec": -90.0, "status": -1}
    assert picture.encode(values) == POSITION
    assert picture.decode(POSITION) == values


@each(
    ("ra", "dec", "written"),
    [
        (0.0, 0.0, "00000000 00000000"),
        (360.0, 90.0, "00000000 00000040"),
        (359.99999999, 0.0, "00000000 00000000"),
        (15.0, -0.0000000838, "ABAAAA0A FFFFFFFF"),
        (270.0, -45.0, "000000C0 000000E0"),
    ],
)
def test_stellarium_goto_message_encodes_coordinates_of_the_whole_sky(ra: float, dec: float, written: str) -> None:
    picture = COMMANDS["goto"].request
    assert picture.encode({"time": 0, "ra": ra, "dec": dec})[12:] == bytes.fromhex(written)


@pytest.mark.parametrize(
    "pieces",
    [
        pytest.param([GOTO], id="whole"),
        pytest.param([bytes((byte,)) for byte in GOTO], id="byte by byte"),
        pytest.param([GOTO + GOTO[:7], GOTO[7:]], id="with trailing bytes, which are the beginning of the next"),
        pytest.param([GOTO[:3], GOTO[3:] + GOTO], id="in two halves"),
    ],
)
def test_stellarium_messages_are_read_however_bytes_are_cut(pieces: list[bytes]) -> None:
    framer = StellariumFramer()
    frames = [frame for number, piece in enumerate(pieces) for frame in framer.feed(piece, 10.0 + number * 0.05)]
    assert frames == [GOTO] * (sum(map(len, pieces)) // len(GOTO))
    assert framer.idle and not framer.dropped


def test_stellarium_surface_ignores_whole_messages_of_another_type() -> None:
    other = bytes.fromhex("0600 0100 1400")
    assert StellariumFramer().feed(other + GOTO, 10.0) == [other, GOTO]
    assert load("stellarium").find(other) is None


@each("noise", ["0000 0000", "0300 0000", "3A475223", "FFFF 0000"])
def test_stellarium_surface_drops_malformed_bytes_until_the_line_is_quiet(noise: str) -> None:
    framer = StellariumFramer()
    assert framer.feed(bytes.fromhex(noise) + GOTO, 10.0) == []
    assert framer.feed(GOTO, 10.05) == []
    assert not framer.idle and GOTO in b"".join(framer.dropped.values())
    assert framer.feed(GOTO, 10.2) == [GOTO]


def test_half_a_stellarium_message_is_not_completed_by_later_bytes() -> None:
    framer = StellariumFramer()
    assert framer.feed(GOTO[:12], 10.0) == []
    assert framer.feed(GOTO[12:] + GOTO, 11.5) == []
    assert framer.dropped
    assert framer.feed(GOTO, 11.7) == [GOTO]


def test_half_a_stellarium_message_is_dropped_when_the_connection_ends() -> None:
    framer = StellariumFramer()
    framer.feed(GOTO[:12], 10.0)
    assert framer.end() == []
    assert list(framer.dropped.values()) == [GOTO[:12]]
