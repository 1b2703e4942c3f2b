"""Motors through the NexStar surface: sense, rates, guiding, tracking modes, axes. The bytes are typed by hand."""

from __future__ import annotations

import pytest

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Unsupported
from tests.support.each import each
from tests.support.fake_mount import Mount, Talk


def talk_to(model: str = "6-8se", mount: Mount | None = None, version: str | None = None) -> Talk:
    return Talk(mount, protocol="nexstar", model=model, version=version)


def asked(*frames: bytes, model: str = "6-8se") -> list[op.Operation]:
    talk = talk_to(model)
    for frame in frames:
        assert talk.send(frame) == b"#"
    return talk.mount.asked


#: Keys 1 to 9 of a 6/8SE and a CGE, degrees a second: 0.5, 1, 4, 8, 16 and 64 times sidereal, then 1, 3 and 5 degrees.
KEYS = [0.002089, 0.004178, 0.016712, 0.033425, 0.066849, 0.267397, 1.0, 3.0, 5.0]

# --- fixed rates ----------------------------------------------------------------------------------------------------


@each("model", ["6-8se", "cge"])
@each("latitude", [45.0, -45.0])
@each(("device", "command", "axis", "sense"), [(16, 36, 1, 1), (16, 37, 1, -1), (17, 36, 2, 1), (17, 37, 2, -1)])
def test_nexstar_motor_directions_reach_the_mount_unchanged(
    model: str, latitude: float, device: int, command: int, axis: int, sense: int
) -> None:
    """Whatever hemisphere and side of the pier: programs make their own north of it, each in its way."""
    mount = Mount()
    mount.site, mount.pier = op.Place(latitude, 10.0), "W"
    talk = talk_to(model, mount)
    for key in range(1, 10):
        mount.asked.clear()
        assert talk.send(bytes((80, 2, device, command, key, 0, 0, 0))) == b"#"
        (asked,) = mount.asked
        assert (asked.axis, asked.sense, asked.rate.key) == (axis, sense, key)
        assert round(asked.rate.degrees, 6) == KEYS[key - 1]
        mount.asked.clear()
        assert talk.send(bytes((80, 2, device, command, 0, 0, 0, 0))) == b"#"
        assert mount.asked == [op.StopAxis(axis)]


def test_unknown_nexstar_key_rate_moves_nothing() -> None:
    for key in (10, 35, 255):
        talk = talk_to()
        assert talk.send(bytes((80, 2, 16, 36, key, 0, 0, 0))) == b"\0#", "the form for no"
        assert talk.mount.asked == []


def test_nexstar_arrow_motion_is_not_reported_as_a_goto() -> None:
    assert talk_to().send(b"P\x02\x10\x24\x09\0\0\0L") == b"#0#"


# --- variable rates -------------------------------------------------------------------------------------------------


@each(("device", "axis"), [(16, 1), (17, 2)])
@each(("command", "sense"), [(6, 1), (7, -1)])
@each(("code", "arcseconds"), [(1, 0.25), (60, 15.0), (600, 150.0), (0x2323, 2248.75), (0xFFFC, 16383.0)])
def test_nexstar_rate_of_16_bits_counts_quarter_arcseconds(
    device: int, axis: int, command: int, sense: int, code: int, arcseconds: float
) -> None:
    (move,) = asked(bytes((80, 3, device, command, code >> 8, code & 255, 0, 0)))
    assert isinstance(move, op.MoveAxis)
    assert (move.axis, move.sense, move.rate.key, move.rate.name) == (axis, sense, None, None)
    assert move.rate.degrees == pytest.approx(arcseconds / 3600, rel=1e-12)


@each(("device", "axis"), [(16, 1), (17, 2)])
@each(("command", "sense"), [(6, 1), (7, -1)])
@each(
    ("code", "arcseconds"),
    [(1, 1 / 1024), (0x025800, 150.0), (0x232323, 2248.7841796875), (0xFFFFFF, 16383.9990234375)],
)
def test_nexstar_rate_of_24_bits_counts_fractions_of_an_arcsecond(
    device: int, axis: int, command: int, sense: int, code: int, arcseconds: float
) -> None:
    (move,) = asked(bytes((80, 4, device, command)) + code.to_bytes(3, "big") + b"\0")
    assert isinstance(move, op.MoveAxis)
    assert (move.axis, move.sense) == (axis, sense)
    assert move.rate.degrees == pytest.approx(arcseconds / 3600, rel=1e-12)


@each("command", [6, 7])
def test_nexstar_variable_rate_0_halts_its_axis(command: int) -> None:
    assert asked(bytes((80, 3, 16, command, 0, 0, 0, 0))) == [op.StopAxis(1)]
    assert asked(bytes((80, 3, 17, command, 0, 0, 0, 0))) == [op.StopAxis(2)]
    assert asked(bytes((80, 4, 16, command, 0, 0, 0, 0))) == [op.StopAxis(1)]
    assert asked(bytes((80, 4, 17, command, 0, 0, 0, 0))) == [op.StopAxis(2)]


@each("command", [6, 7])
@each(("code", "name"), [(0xFF, "sidereal"), (0xFE, "solar"), (0xFD, "lunar")])
def test_three_nexstar_rate_codes_set_tracking_and_never_slew(command: int, code: int, name: str) -> None:
    assert asked(bytes((80, 3, 16, command, 255, code, 0, 0))) == [op.TrackRate(name=name)]


# --- guiding --------------------------------------------------------------------------------------------------------

ACTIVE = {axis: bytes((80, 1, 15 + axis, 39, 0, 0, 0, 1)) for axis in (1, 2)}


@each("axis", [1, 2])
@each(
    ("rate", "sense", "part"),
    [(50, 1, 0.5), (206, -1, 0.5), (1, 1, 0.01), (255, -1, 0.01), (100, 1, 1.0), (35, 1, 0.35)],
)
@each("ticks", [1, 30, 35, 255])
def test_nexstar_guide_pulse_lasts_as_long_as_requested(
    axis: int, rate: int, sense: int, part: float, ticks: int
) -> None:
    talk = talk_to()
    assert talk.send(ACTIVE[axis]) == b"\0#"
    assert talk.send(bytes((80, 3, 15 + axis, 38, rate, ticks, 0, 0))) == b"#"
    assert talk.mount.asked == [op.PulseAxis(axis, sense, ticks * 10, part)]
    assert talk.send(ACTIVE[axis]) == b"\1#"
    assert talk.send(ACTIVE[3 - axis]) == b"\0#", "the other motor is idle"
    talk.now += ticks / 100 - 0.005
    assert talk.send(ACTIVE[axis]) == b"\1#"
    talk.now += 0.006
    assert talk.send(ACTIVE[axis]) == b"\0#"


def test_nexstar_guide_pulse_of_zero_length_does_nothing() -> None:
    talk = talk_to()
    assert talk.send(b"P\x03\x10&\0\x1e\0\0" + b"P\x03\x10&\x32\0\0\0" + ACTIVE[1]) == b"##\0#"
    assert talk.mount.asked == []


def test_nexstar_guide_pulse_state_is_shared_by_all_clients() -> None:
    talk = talk_to()
    talk.send(b"P\x03\x10&\x32\xff\0\0")
    talk.reconnect()
    talk.session.reset_client()
    assert talk.send(ACTIVE[1]) == b"\1#"


def test_nexstar_guide_rate_and_backlash_read_back_as_set() -> None:
    talk = talk_to()
    assert talk.send(b"P\1\x10G\0\0\0\1" + b"P\1\x11G\0\0\0\1") == b"\x80#\x80#"
    assert talk.send(b"P\2\x10F\x40\0\0\0" + b"P\1\x10G\0\0\0\1" + b"P\1\x11G\0\0\0\1") == b"#\x40#\x80#"
    assert talk.mount.of(op.SetGuideRate) == [op.SetGuideRate(1, 0.25)]
    assert talk.send(b"P\2\x11\x10\x0a\0\0\0" + b"P\2\x11\x11\x14\0\0\0") == b"##"
    assert talk.send(b"P\1\x11\x40\0\0\0\1" + b"P\1\x11\x41\0\0\0\1" + b"P\1\x10\x40\0\0\0\1") == b"\x0a#\x14#\0#"
    talk.mount.asked.clear()
    assert talk.send(b"P\2\x11\x10\x64\0\0\0" + b"P\1\x11\x40\0\0\0\1") == b"\0#\x0a#", "99 is the most"
    assert talk.mount.asked == []


# --- tracking modes -------------------------------------------------------------------------------------------------


@each(
    ("tracking", "code"),
    [(op.Tracking.OFF, 0), (op.Tracking.ALTAZ, 1), (op.Tracking.EQ_NORTH, 2), (op.Tracking.EQ_SOUTH, 3)],
)
def test_nexstar_tracking_mode_reads_back_as_set(tracking: op.Tracking, code: int) -> None:
    talk = talk_to()
    assert talk.send(b"T" + bytes((code,)) + b"t") == b"#" + bytes((code,)) + b"#"
    assert talk.mount.of(op.SetTracking) == [op.SetTracking(on=code > 0, mode=tracking)]


@each("version", ["3.01", "3.02", "3.04"])
@each("model", ["cge", "advanced-gt"])
def test_nexstar_tracking_modes_are_shifted_on_some_german_versions(model: str, version: str) -> None:
    """NexStar protocol, tracking modes of the CGE and Advanced GT 3.01-3.04: EQ north 1, EQ south 2."""
    talk = talk_to(model, version=version)
    assert talk.send(b"t\x54\1") == b"\1##"
    assert talk.send(b"T\2t") == b"#\2#"
    assert talk.mount.of(op.SetTracking)[-1].mode is op.Tracking.EQ_SOUTH
    assert talk.send(b"T\0t") == b"#\0#"
    assert talk.send(b"T\3t") == b"#\0#", "there is no such mode"


@each(("model", "version"), [("cge", "2.3"), ("cge", "4.10"), ("6-8se", "3.02"), ("cgem", "4.21")])
def test_nexstar_tracking_modes_are_not_shifted_on_other_versions(model: str, version: str) -> None:
    assert talk_to(model, version=version).send(b"t\x54\3t") == b"\2##\3#"


def test_nexstar_mount_that_cannot_stop_tracking_still_reports_tracking() -> None:
    talk = talk_to()
    talk.mount.faults[op.SetTracking] = Unsupported()
    assert talk.send(b"T\0t") == b"#\2#"
    del talk.mount.faults[op.SetTracking]
    assert talk.send(b"T\2t") == b"#\2#"
    talk.mount.faults[op.SetTracking] = NoAnswer()
    assert talk.send(b"T\0t") == b"\2#", "what was not done for want of an answer is not acknowledged, and not kept"


# --- gotos and axes -------------------------------------------------------------------------------------------------


def test_nexstar_z_reports_azimuth_on_a_fork_and_axis_angles_on_a_german_mount() -> None:
    mount = Mount()
    mount.horizontal, mount.axes = op.Horizontal(180.0, 40.0), op.Horizontal(270.0, 100.0)
    assert talk_to("6-8se", mount).send(b"Zz") == b"8000,1C72#80000000,1C71C700#"
    assert talk_to("cge", mount).send(b"Zz") == b"C000,471C#C0000000,471C7200#"
    for command in (b"BC000,2000", b"bC0000000,20000000"):
        assert talk_to("6-8se", mount).send(command + b"L") == b"#1#"
        assert talk_to("cge", mount).send(command + b"L") == b"#1#"
    assert mount.of(op.GotoHorizontal) == [op.GotoHorizontal(270.0, 45.0)] * 2
    assert mount.of(op.GotoAxes) == [op.GotoAxes(270.0, 45.0)] * 2


def test_nexstar_declination_past_the_pole_is_folded() -> None:
    talk = talk_to()
    assert talk.send(b"R0000,4800" + b"r80000000,B8000000") == b"##"
    assert talk.mount.of(op.Goto) == [op.Goto(180.0, 78.75), op.Goto(0.0, -78.75)]
    talk.mount.position = op.Equatorial(180.0, 78.75)
    assert talk.send(b"s00000000,48000000") == b"#"
    assert talk.mount.of(op.Sync) == [op.Sync(180.0, 78.75)]


@each("low", [b"00", b"FF", b"7f", b"\0\0", b"##", b"zz", b",,", b"  ", b"\r\n", b"\t\t", b"1 ", b"_1"])
def test_low_byte_of_a_nexstar_position_is_ignored(low: bytes) -> None:
    talk = talk_to()
    assert talk.send(b"r355555" + low + b",200000" + low) == b"#"
    (goto,) = talk.mount.of(op.Goto)
    assert goto.ra == pytest.approx(75.0, abs=360 / 2**24)
    assert goto.dec == pytest.approx(45.0, abs=360 / 2**24)


def test_nexstar_goto_of_one_motor_leaves_the_other_on_its_course() -> None:
    talk = talk_to()
    talk.mount.horizontal = op.Horizontal(180.0, -45.0)
    assert talk.send(b"P\1\x10\1\0\0\0\3" + b"P\1\x11\1\0\0\0\3") == b"\x80\0\0#\xe0\0\0#"
    assert talk.send(b"P\1\x10\x13\0\0\0\1") == b"\xff#"
    talk.mount.horizontal = op.Horizontal(180.0, 45.0)
    assert talk.send(b"P\4\x10\2\x40\0\0\0") == b"#"
    assert talk.mount.of(op.GotoHorizontal)[-1] == op.GotoHorizontal(90.0, 45.0), "the other one stays"
    assert talk.send(b"P\1\x11\x13\0\0\0\1") == b"\0#"
    assert talk.send(b"P\4\x11\x17\x10\0\0\0") == b"#"
    assert talk.mount.of(op.GotoHorizontal)[-1] == op.GotoHorizontal(90.0, 22.5), "the first one goes on"
    talk.mount.slewing, talk.mount.horizontal = False, op.Horizontal(200.0, 60.0)
    assert talk.send(b"P\4\x11\2\x20\0\0\0") == b"#"
    assert talk.mount.of(op.GotoHorizontal)[-1] == op.GotoHorizontal(200.0, 45.0), "an old goal is forgotten"
    german = talk_to("cge")
    german.mount.axes = op.Horizontal(90.0, 100.0)
    assert german.send(b"P\1\x11\1\0\0\0\3") == b"\x47\x1c\x72#"
    assert german.send(b"P\4\x11\2\xf0\0\0\0") == b"#"
    assert german.mount.of(op.GotoAxes) == [op.GotoAxes(90.0, -22.5)]


def test_nexstar_sky_goto_discards_an_earlier_goto_of_a_single_motor() -> None:
    talk = talk_to()
    talk.send(b"P\4\x10\2\x40\0\0\0" + b"r35555500,20000000" + b"P\4\x11\2\x20\0\0\0")
    assert talk.mount.of(op.GotoHorizontal)[-1] == op.GotoHorizontal(180.0, 45.0)


@each(("model", "pier", "letter"), [("cge", "E", b"E#"), ("cge", "W", b"W#"), ("6-8se", "W", b"E#")])
def test_nexstar_pier_side_is_reported_for_german_mounts(model: str, pier: str, letter: bytes) -> None:
    talk = talk_to(model)
    talk.mount.pier = pier
    assert talk.send(b"p") == letter


def test_nexstar_pier_side_query_is_answered_though_the_mount_cannot_tell() -> None:
    talk = talk_to("cge")
    talk.mount.faults[op.PierSide] = Unsupported()
    assert talk.send(b"p") == b"E#", "programs ask it with every position"


def test_nexstar_hibernation_and_pec_commands_are_passed_on() -> None:
    assert asked(b"x", b"y") == [op.Hibernate(), op.Wake()]
    assert asked(b"P\2\x10\x0d\1\0\0\0", b"P\2\x10\x0d\0\0\0\0", model="cge") == [
        op.PeriodicError(1, True),
        op.PeriodicError(1, False),
    ]
    assert talk_to(version="5.31").send(b"u") == b"#"
