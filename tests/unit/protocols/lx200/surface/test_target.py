"""Targets, gotos, syncs and altitude limits, by the bytes a client sends and gets."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from gateway.core import errors
from gateway.core import operations as op
from gateway.mount.policy import Limits
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Mount, Talk

TARGET = b":Sr05:34:32#:Sd+22*00:52#"
REFUSED_RA = (b":Sr24:00:00#", b":Sr12:61:00#", b":Sr12:00:61#", b":Sr-00:00:00#", b":Sr#", b":Srabc#", b":Sr05#")
REFUSED_DEC = (b":Sd+91*00:00#", b":Sd+90*00:01#", b":Sd-90*00:01#", b":Sd+45*99#", b":Sd#", b":Sd+22#")


# --- targets ------------------------------------------------------------------------------------------------------


@each("half", REFUSED_RA + REFUSED_DEC)
def test_refused_coordinate_clears_the_whole_lx200_target(half: bytes) -> None:
    talk = Talk()
    assert talk.send(TARGET) == b"11"
    assert talk.send(half) == b"0"
    assert talk.send(b":MS#") == b"1No target set.#"
    assert talk.send(b":CM#") == b"#"
    assert talk.mount.asked == []


@each("other", [b":Sd+22*00:52#", b":Sr05:34:32#"])
def test_lx200_goto_needs_both_coordinates_after_a_refusal(other: bytes) -> None:
    talk = Talk()
    talk.send(TARGET + b":Sr25:00:00#")
    assert talk.send(other + b":MS#") == b"11No target set.#"
    assert talk.send(TARGET + b":MS#") == b"110"


@each("half", [b":Sa+91*00#", b":Saabc#", b":Sz361*00#", b":Sz#"])
def test_refused_horizontal_half_clears_only_the_horizontal_target(half: bytes) -> None:
    talk = Talk()
    assert talk.send(TARGET + b":Sz180*00#:Sa+45*00#" + half + b":MA#") == b"111101"
    assert talk.send(b":MS#") == b"0"


@some
@given(st.integers(0, 86399), st.integers(-324000, 324000))
def test_lx200_target_is_read_back_as_set(ra: int, dec: int) -> None:
    hours = b"%02d:%02d:%02d" % (ra // 3600, ra // 60 % 60, ra % 60)
    size = abs(dec)
    degrees = b"%s%02d*%02d:%02d" % (b"-" if dec < 0 else b"+", size // 3600, size // 60 % 60, size % 60)
    talk = Talk()
    assert talk.send(b":Sr%s#:Sd%s#:Gr#:Gd#" % (hours, degrees)) == b"11%s#%s#" % (hours, degrees)
    talk.send(b":CM#")
    (sync,) = talk.mount.of(op.Sync)
    assert sync.ra == pytest.approx(ra / 240)
    assert sync.dec == pytest.approx(dec / 3600)


def test_lx200_goto_passes_its_target_and_altitude_limits_to_the_mount() -> None:
    talk = Talk()
    talk.send(TARGET + b":So10#:Sh80#:MS#")
    (goto,) = talk.mount.of(op.Goto)
    assert goto.ra == pytest.approx((5 + 34 / 60 + 32 / 3600) * 15)
    assert goto.dec == pytest.approx(22 + 52 / 3600)
    assert (goto.lowest, goto.highest, goto.track) == (10.0, 80.0, True)


def test_lx200_goto_in_land_mode_starts_no_tracking() -> None:
    talk = Talk()
    talk.send(b":AL#" + TARGET + b":MS#:AP#:MS#")
    assert [goto.track for goto in talk.mount.of(op.Goto)] == [False, True]


# --- refusals -----------------------------------------------------------------------------------------------------


@each(
    ("fault", "reply"),
    [
        (errors.BelowHorizon(), b"1Object Below Horizon.#"),
        (errors.TooHigh("Object Above Higher Limit."), b"2Object Above Higher Limit.#"),
        (errors.NotAligned(), b"1Mount not aligned.#"),
        (errors.NoAnswer(), b"1No answer from mount.#"),
        (errors.Stopped(), b"1Stopped.#"),
        (errors.Unsupported("The mount # is too old."), b"1The mount   is too old.#"),
    ],
)
def test_lx200_goto_is_refused_with_a_digit_and_a_text(fault: errors.Fault, reply: bytes) -> None:
    talk = Talk()
    talk.mount.fault = fault
    assert talk.send(TARGET + b":MS#") == b"11" + reply
    assert talk.send(b":Sz180*00#:Sa+45*00#:MA#") == b"111"
    assert talk.send(b":CM#") == b"#"
    talk.mount.fault = None
    assert talk.send(b":MS#") == b"0", "the mount's refusal is none of the target's"


# --- limits -------------------------------------------------------------------------------------------------------


def _altitude(mount: Mount, ra: float, dec: float) -> float:
    return mount.sky.az_alt(ra, dec, mount.site.latitude, mount.site.longitude, mount.clock.unix)[1]


def test_target_exactly_at_a_limit_is_allowed() -> None:
    talk = Talk()
    altitude = _altitude(talk.mount, (5 + 34 / 60 + 32 / 3600) * 15, 22 + 52 / 3600)
    assert 40 < altitude < 80
    for limits, reply in [
        (Limits(lowest=altitude), b"0"),
        (Limits(lowest=altitude + 0.15), b"1Object Below Lower Limit.#"),
        (Limits(highest=altitude), b"0"),
        (Limits(highest=altitude - 0.15), b"2Object Above Higher Limit.#"),
    ]:
        talk.mount.limits = limits
        assert talk.send(TARGET + b":MS#") == b"11" + reply


def test_altitude_exactly_at_a_clients_limit_is_allowed() -> None:
    talk = Talk()
    assert talk.send(b":Sz180*00#:So20#:Sh60*#") == b"111"
    assert talk.send(b":Sa+20*00#:MA#:Sa+60*00#:MA#") == b"1010"
    assert talk.send(b":Sa+19*53:00#:MA#:Sa+60*07:00#:MA#") == b"0101", "and nothing is chosen"


def _limited(lowest: float, highest: float) -> Talk:
    """A client of a gateway whose operator has set limits."""
    talk = Talk()
    talk.mount.limits = Limits(lowest, highest)
    talk.session.client_settings = replace(talk.session.client_settings, limits=talk.mount.limits)
    return talk


def test_lx200_client_may_narrow_the_operators_limits() -> None:
    talk = _limited(10, 80)
    assert talk.send(b":Go#:Gh#") == b"10*#80*#"
    assert talk.send(b":So20#:Sh4200#:Go#:Gh#") == b"1120*#70*#"
    assert talk.send(b":So1500#:Sh60*#:Go#:Gh#") == b"1125*#60*#"
    assert talk.send(b":Sz000*00#:Sa+24*00#:MA#:Sa+25*00#:Sz000*00#:MA#:Sa+61*00#:MA#") == b"10111001"


@some
@example(0, 5400)
@given(st.integers(0, 90), st.integers(1000, 5400))
def test_no_lx200_client_widens_the_operators_limits(lowest: int, highest: int) -> None:
    talk = _limited(10, 80)
    low = b"1" if lowest < 80 else b"0"  # nothing would be left
    high = b"1" if highest / 60.0 > (max(10, lowest) if low == b"1" else 10) else b"0"
    assert talk.send(b":So%d#:Sh%d#" % (lowest, highest)) == low + high
    assert float(talk.send(b":Go#").rstrip(b"*#")) >= 10
    assert float(talk.send(b":Gh#").rstrip(b"*#")) <= 80
    assert talk.send(b":Sz000*00#:Sa+09*50#:MA#:Sa+80*10#:MA#") == b"10101"


def test_lx200_limits_belong_to_one_client() -> None:
    one, other = Talk(mount := Mount()), Talk(mount)
    assert one.send(b":So30#:Sz180*00#:Sa+20*00#:MA#") == b"1101"
    assert other.send(b":Go#:Sz180*00#:Sa+20*00#:MA#") == b"00*#110"


# --- sync, bars ---------------------------------------------------------------------------------------------------


def test_lx200_sync_text_tells_success_from_refusal() -> None:
    near, far = b":Sr12:40:00#:Sd+45*00:00#", b":Sr05:34:32#:Sd+22*00:52#"
    assert Talk().send(near + b":CM#") == b"11 M31 EX GAL MAG 3.5 SZ178.0'#"
    assert Talk(model="lx200").send(near + b":CM#") == b"11Coordinates     matched.        #"
    assert Talk(sync_text="1Done.").send(near + b":CM#") == b"111Done.#"
    assert Talk().send(far + b":CM#") == b"11#"
    assert Talk().send(b":CM#") == b"#"


@each("model", ["autostar", "lx200", "lx200-16", "lx200gps"])
def test_lx200_distance_bar_lasts_from_the_goto_reply_to_its_end(model: str) -> None:
    talk = Talk(model=model)
    assert talk.send(b":D#" + TARGET + b":MS#:D#") == b"#110\x7f#"
    talk.mount.slewing = False
    assert talk.send(b":D#") == b"#"
