"""What the NexStar surface is as a whole: never upset, exact to half a tick, silent until it is asked."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.core import operations as op
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Mount, Talk

LETTERS = [letter.encode() for letter in "EeZzRrBbSsTtPWwHhVvmKJLMplxyiIu"]


def talk_to(model: str = "6-8se", mount: Mount | None = None, version: str | None = None) -> Talk:
    return Talk(mount, protocol="nexstar", model=model, version=version)


@some
@given(st.lists(st.one_of(st.binary(max_size=20), st.sampled_from(LETTERS), st.just(b"P\2\x10\x24")), max_size=30))
@pytest.mark.parametrize(("model", "version"), [("6-8se", "4.21"), ("cge", "3.02"), ("cgx", "5.31")])
def test_no_bytes_break_the_nexstar_surface(model: str, version: str, pieces: list[bytes]) -> None:
    talk = talk_to(model, version=version)
    talk.send(b"".join(pieces))
    talk.wait(5)  # the end of an incomplete command is no longer expected either
    assert talk.send(b"Kz") == b"z#"


@some
@given(st.floats(0, 360, exclude_max=True), st.floats(-90, 90))
def test_nexstar_positions_are_capital_hex_and_exact_to_half_a_tick(ra: float, dec: float) -> None:
    talk = talk_to()
    talk.mount.position, talk.mount.horizontal = op.Equatorial(ra, dec), op.Horizontal(ra, dec)
    precise, short = rb"([0-9A-F]{6}00),([0-9A-F]{6}00)#", rb"([0-9A-F]{4}),([0-9A-F]{4})#"
    for command, pattern, bits in ((b"e", precise, 24), (b"E", short, 16), (b"z", precise, 24), (b"Z", short, 16)):
        found = re.fullmatch(pattern, talk.send(command))
        assert found
        for digits, wanted in zip(found.groups(), (ra, dec), strict=True):
            turns = int(digits, 16) / 16 ** len(digits)
            assert abs((turns * 360 - wanted + 180) % 360 - 180) <= 180 / 2**bits + 1e-9


@some
@given(st.integers(0, 2**32 - 1), st.integers(0, 2**30), st.booleans())
def test_nexstar_coordinates_in_either_case_mean_the_same_place(ra: int, dec: int, small: bool) -> None:
    talk = talk_to()
    frame = b"%08X,%08X" % (ra, dec)
    assert talk.send(b"s" + (frame.lower() if small else frame)) == b"#"
    (sync,) = talk.mount.of(op.Sync)
    assert abs((sync.ra - ra / 2**32 * 360 + 180) % 360 - 180) <= 180 / 2**24 + 1e-9
    assert abs(sync.dec - dec / 2**32 * 360) <= 180 / 2**24 + 1e-9


@each(("aligned", "reply"), [(True, b"\1#"), (False, b"\0#")])
def test_nexstar_reports_alignment_as_a_byte_and_slewing_as_a_digit(aligned: bool, reply: bytes) -> None:
    talk = talk_to()
    talk.mount.status = op.Status(op.Tracking.ALTAZ, aligned=aligned, equatorial=False)
    assert talk.send(b"JL") == reply + b"0#"
    talk.mount.slewing = True
    assert talk.send(b"L") == b"1#"


def test_default_nexstar_hand_control_version_is_4_21() -> None:
    """At least 4.10 for syncs, 4.15 for the side of the pier, not 4.20, less than 5.28."""
    assert talk_to().send(b"Vm") == b"\x04\x15#\x0c#"
    assert talk_to("cge").send(b"Vm") == b"\x04\x15#\x05#"


def test_every_nexstar_echo_returns_one_byte() -> None:
    talk = talk_to()
    for byte in range(256):
        assert talk.send(bytes((75, byte))) == bytes((byte, 35))


def test_nexstar_position_is_reported_of_date_without_precession() -> None:
    """Of date, as a hand control's is: nothing is precessed on the way."""
    talk = talk_to()
    talk.send(b"r35555500,20000000")
    assert talk.mount.of(op.Goto) == [op.Goto(0x355555 / 2**24 * 360, 45.0)]


def test_nexstar_sidereal_time_is_a_part_of_a_turn_in_hex_digits() -> None:
    talk = talk_to()
    reply = talk.send(b"l")
    wanted = talk.mount.perform(op.SiderealTime())
    assert re.fullmatch(rb"[0-9A-F]{6}00#", reply)
    assert int(reply[:8], 16) / 2**32 * 360 == pytest.approx(wanted, abs=360 / 2**24)


def test_every_nexstar_command_has_a_row_in_surface_toml() -> None:
    protocol = load("nexstar")
    assert set(protocol.commands) == set(protocol.surface_rows)


@each("version", ["1.2", "1.6", "2.2", "4.21", "5.31"])
def test_get_variant_command_is_answered_at_every_version(version: str) -> None:
    """One program asks it of every hand control, and waits five seconds for it, twice."""
    assert talk_to(version=version).send(b"v") == b"\x11#"
