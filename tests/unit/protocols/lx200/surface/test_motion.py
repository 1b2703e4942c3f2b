"""Arrows, rates, stops, guiding and tracking: what is asked of the mount for the bytes a client sends."""

from __future__ import annotations

from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Unsupported
from gateway.core.operations import Direction, Rate
from tests.support.each import each
from tests.support.fake_mount import Mount, Talk


def asked(*frames: bytes, model: str = "autostar") -> list[Any]:
    """The operations that a client's commands lead to; none of these commands may have a reply."""
    talk = Talk(model=model)
    assert talk.send(b"".join(frames)) == b""
    return talk.mount.asked


# --- arrows -------------------------------------------------------------------------------------------------------


@each(
    ("letter", "direction"),
    [(b"n", Direction.NORTH), (b"s", Direction.SOUTH), (b"e", Direction.EAST), (b"w", Direction.WEST)],
)
@each(
    ("choice", "rate"),
    [
        (b":RG#", Rate(name="guide")),
        (b":RC#", Rate(name="center")),
        (b":RM#", Rate(name="find")),
        (b":RS#", Rate(name="max")),
        (b":R0#", Rate(key=1)),
        (b":R1#", Rate(key=1)),
        (b":R9#", Rate(key=9)),
        (b":RG#:RS#", Rate(name="max")),
    ],
)
def test_lx200_arrow_moves_at_the_chosen_rate(letter: bytes, direction: Direction, choice: bytes, rate: Rate) -> None:
    assert asked(choice + b":M%s#" % letter) == [op.Move(direction, rate)]


def test_lx200_arrow_rate_applies_to_its_client_only() -> None:
    one, other = Talk(mount := Mount()), Talk(mount)
    one.send(b":RS#")
    other.send(b":RG#:Mn#")
    one.send(b":Mn#")
    assert [move.rate for move in mount.of(op.Move)] == [Rate(name="guide"), Rate(name="max")]


def test_lx200_sw_limits_the_fastest_rate() -> None:
    talk = Talk()
    assert talk.send(b":Sw4#:Mn#") == b"1"
    assert talk.send(b":RG#:Mn#:RS#:Mn#") == b""
    fastest = Rate(name="max", degrees=4.0)
    assert [move.rate for move in talk.mount.of(op.Move)] == [fastest, Rate(name="guide"), fastest]
    assert talk.send(b":Sw1#:Sw9#:Sw#:Mn#") == b"000"
    assert talk.mount.of(op.Move)[-1].rate == fastest


def test_lx200_axis_rate_holds_for_its_axis_until_another_is_chosen() -> None:
    moves = asked(b":RA1.5#:RE0.2#:Mw#:Mn#:RM#:Mw#:Mn#", model="lx200gps")
    assert [move.rate for move in moves] == [Rate(degrees=1.5), Rate(degrees=0.2), Rate(name="find"), Rate(name="find")]
    assert [move.rate for move in asked(b":RC#:RA1.5#:Mn#:RA0#:Me#", model="lx200gps")] == [Rate(name="center")] * 2


def test_lx200_guide_rate_is_a_sidereal_fraction_on_both_axes() -> None:
    first, second = asked(b":Rg7.5#", model="lx200gps")
    assert (first.axis, second.axis) == (1, 2)
    assert first.rate == second.rate == pytest.approx(0.4986, abs=1e-3)
    assert [step.rate for step in asked(b":Rg30.0#", model="lx200gps")] == [1.0, 1.0]


# --- stops and guiding --------------------------------------------------------------------------------------------


def test_lx200_stop_ends_all_motion_and_a_directional_stop_its_axis() -> None:
    assert asked(b":Q#") == [op.AbortMotion()]
    assert asked(b":Qn#:Qs#:Qe#:Qw#") == [op.StopAxis(2), op.StopAxis(2), op.StopAxis(1), op.StopAxis(1)]


@each(
    ("frame", "pulse"),
    [
        (b":Mgn0500#", op.Pulse(Direction.NORTH, 500)),
        (b":Mgs0001#", op.Pulse(Direction.SOUTH, 1)),
        (b":Mge10000#", op.Pulse(Direction.EAST, 10000)),
        (b":Mgw20#", op.Pulse(Direction.WEST, 20)),
        (b":Mgn999999#", op.Pulse(Direction.NORTH, 60000)),
    ],
)
def test_lx200_guide_pulse_has_direction_and_milliseconds(frame: bytes, pulse: op.Pulse) -> None:
    assert asked(frame) == [pulse]


@each("frame", [b":Mg#", b":Mgn#", b":Mgx0500#", b":Mgn-500#", b":Mgnabc#"])
def test_half_an_lx200_guide_pulse_moves_nothing(frame: bytes) -> None:
    assert asked(frame) == []


def test_lx200_command_without_a_reply_stays_silent_when_the_mount_fails() -> None:
    talk = Talk()
    talk.mount.fault = NoAnswer()
    assert talk.send(b":Mn#:Qn#:Q#:Mgn0500#:hP#:TQ#:AL#:AP#:F+#:hW#") == b""


# --- tracking -----------------------------------------------------------------------------------------------------


@each(
    ("frames", "told", "rate"),
    [
        (b":TQ#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":TS#", b"60.0#", op.TrackRate(name="solar")),
        (b":TL#", b"58.7#", op.TrackRate(name="lunar")),
        (b":ST060.1#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":ST60.1#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":T060.164#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":ST060.2#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":ST060.3#", b"60.3#", op.TrackRate(factor=60.3 / 60.16427)),
        (b":ST057.9#", b"57.9#", op.TrackRate(factor=57.9 / 60.16427)),
        (b":T053.082#", b"53.1#", op.TrackRate(factor=53.082 / 60.16427)),
        (b":TM#", b"60.1#", op.TrackRate(name="sidereal")),
        (b":TM#:T+#:T+#", b"60.3#", op.TrackRate(factor=60.3 / 60.16427)),
        (b":T-#", b"60.0#", op.TrackRate(factor=60.0 / 60.16427)),
        (b":ST058.0#:TQ#:TM#", b"58.0#", op.TrackRate(factor=58.0 / 60.16427)),
    ],
)
def test_lx200_tracking_rate_command_sets_the_drive_rate(frames: bytes, told: bytes, rate: op.TrackRate) -> None:
    talk = Talk()
    talk.send(frames)
    assert talk.mount.of(op.TrackRate)[-1] == rate
    assert talk.send(b":GT#") == told


@each("frame", [b":ST000.0#", b":ST100.0#", b":ST#", b":T000.000#", b":T100.0#", b":T#", b":T-59.5#"])
def test_impossible_lx200_tracking_rate_is_refused(frame: bytes) -> None:
    talk = Talk()
    assert talk.send(frame + b":GT#") == b"060.1#"
    assert talk.mount.of(op.TrackRate) == []


@each("frame", [b":ST059.5#", b":T059.5#"])
def test_lx200_tracking_rate_that_the_mount_lacks_is_refused_by_a_reply(frame: bytes) -> None:
    """A program waits for the character."""
    talk = Talk()
    talk.mount.faults[op.TrackRate] = Unsupported("This mount tracks at the sidereal rate only.")
    assert talk.send(frame) == b"0"


@each(("start", "step", "told"), [(b":T050.2#", b":T-#", b"50.0#"), (b":T069.8#", b":T+#", b"70.0#")])
def test_lx200_tracking_rate_steps_stop_at_50_and_70_hertz(start: bytes, step: bytes, told: bytes) -> None:
    talk = Talk()
    assert talk.send(start + step * 5 + b":GT#") == b"1" + told
    assert all(0 < rate.factor < 1.7 for rate in talk.mount.of(op.TrackRate))


def test_lx200_tracking_rate_is_shared_by_all_clients() -> None:
    one, other = Talk(), Talk()
    other.mount = one.mount
    one.send(b":TL#")
    assert other.send(b":GT#") == b"58.7#"


def test_lx200_land_mode_turns_tracking_off_and_other_modes_on() -> None:
    assert asked(b":AL#") == [op.SetTracking(on=False)]
    assert asked(b":AP#") == asked(b":AA#") == [op.SetTracking(on=True)]


def test_lx200_park_home_and_sleep_commands_reach_the_mount() -> None:
    assert asked(b":hP#:hF#:hS#:hN#:hW#", model="lx200gps") == [
        op.Park(),
        op.Home(),
        op.SetHome(),
        op.Hibernate(),
        op.Wake(),
    ]
    assert Talk().send(b":h?#") == b"0"
