"""The simulated hand control against bytes typed by hand, and against the sky."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.astro.ephemeris.closed_forms import sidereal_time
from gateway.astro.spherical import wrap180
from gateway.core.errors import UserError
from gateway.protocols.nexstar.simulator.hand_control import HANDLERS, SimulatedHandControl
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.examples import some

#: 19:26:00 UT, 6 April 2005: the manual's example, 3:26 PM in New York in summer.
APRIL = 1112815560.0
MANUAL_SITE = (33 + 50 / 60 + 41 / 3600, -(118 + 20 / 60 + 17 / 3600))
ABSENT = b"\0\0\0#"  # two bytes were asked for


class Bench:
    """A hand control and a clock that a test moves."""

    def __init__(self, model: str = "6-8se", version: str | None = "4.21", now: float = APRIL, **more: object) -> None:
        self.now = now
        more.setdefault("site", MANUAL_SITE)
        self.sim = SimulatedHandControl(model, version, clock=lambda: self.now, **more)  # type: ignore[arg-type]

    def __call__(self, request: bytes | str) -> bytes:
        """Send bytes, or hexadecimal digits with blanks."""
        return self.sim.feed(bytes.fromhex(request) if isinstance(request, str) else request)

    def after(self, seconds: float) -> Bench:
        self.now += seconds
        return self

    def settle(self) -> Bench:
        """Poll ``L`` as a client does until the goto is over."""
        for _ in range(600):
            if self(b"L") == b"0#":
                return self
            self.after(1.0)
        raise AssertionError("the goto does not end")

    def place(self) -> tuple[float, float]:
        ra, dec = self(b"e")[:-1].split(b",")
        return int(ra, 16) * 360 / 2**32, wrap180(int(dec, 16) * 360 / 2**32)


def daylight(bench: Bench) -> Bench:
    assert bench(b"H\x0f\x1a\x00\x04\x06\x05\xfb\x01") == b"#"
    return bench


# --- transcripts of real clients, the hand control's side --------------------------------------------------


def test_simulated_german_hand_control_obeys_goto_stop_and_park_of_indi() -> None:
    bench = Bench("cge")
    assert bench(b"t") == b"\x02#"
    assert bench("50 01 10 47 00 00 00 01") == b"\x80#"
    assert bench("50 01 11 47 00 00 00 01") == b"\x80#"
    assert bench(b"r35555555,EAAAAAAA") == b"#"
    assert bench(b"L") == b"1#"
    bench.after(3)
    assert bench(b"L") == b"1#"
    bench.settle()
    assert bench(b"e") == b"35555500,EAAAAB00#"
    assert bench(b"p") in (b"E#", b"W#")
    assert bench(b"T\x02") == b"#"
    assert bench.after(60)(b"e") == b"35555500,EAAAAB00#"
    bench(b"rB5555555,2AAAAAAA")
    bench.after(3)
    for stop in ("50 02 11 24 00 00 00 00", "50 02 10 24 00 00 00 00"):
        assert bench(stop) == b"#" and bench(stop) == b"#"
    assert bench(b"M") == b"#"
    assert bench(b"L") == b"0#"
    assert bench(b"b00000000,1C71C71C") == b"#"
    bench.settle()
    assert bench(b"T\x00") == b"#"
    assert bench(b"t") == b"\x00#"
    assert re.fullmatch(rb"0000..00,1C71C700#", bench.after(9)(b"z"))  # it tracked until T 0


def test_simulated_guide_pulses_need_newer_motors() -> None:
    old, new = Bench("cge"), Bench("cgem", site=(45.0, 10.0))
    assert old("50 03 10 26 32 1E 00 00") == b"\0#"
    assert old("50 01 10 27 00 00 00 01") == b"\0\0#"
    new(b"B2000,2000")
    new.settle()
    ra, _ = new.sim.true_position()
    assert new("50 03 10 26 32 64 00 00") == b"#"
    assert new("50 01 10 27 00 00 00 01") == b"\x01#"
    assert new.after(2)("50 01 10 27 00 00 00 01") == b"\x00#"
    assert wrap180(new.sim.true_position()[0] - ra) * 3600 == pytest.approx(-7.52, abs=0.01)
    new("50 03 10 26 CE 64 00 00")
    assert wrap180(new.after(2).sim.true_position()[0] - ra) * 3600 == pytest.approx(0, abs=0.01)


# --- the manual's own rows ---------------------------------------------------------------------------------


def manual_state() -> Bench:
    """The state that the hand-typed forms are written for."""
    bench = Bench("cge", now=APRIL - 300)
    bench.sim.facts = {**bench.sim.facts, "has": ["gps", "rtc"]}
    bench.sim.firmware = (6, 11)
    bench(b"T\x00b12AB0500,40000500")
    bench.settle()
    bench.now = APRIL
    daylight(bench)(b"T\x02s34AB0500,12CE0500")
    return bench


FORMS = Path(__file__).parents[4] / "conformance" / "manual" / "nexstar_forms.txt"


def typed(text: str) -> bytes:
    return re.sub(r"\\x(..)", lambda found: chr(int(found[1], 16)), text).encode("latin-1")


def forms() -> list[list[str]]:
    lines = FORMS.read_text("utf-8").splitlines()
    return [line.split(" | ") for line in lines if line and not line.startswith(";;")]


@each("form", forms())
def test_simulated_hand_control_replies_as_the_celestron_manual_says(form: list[str]) -> None:
    _, request, _, reply = form
    answer = manual_state()(typed(request)).decode("latin-1")
    if reply.startswith("re:"):
        assert re.fullmatch(reply[3:], answer, re.DOTALL)
    else:
        assert answer.encode("latin-1") == typed(reply)


VERSIONS = ["1.2", "1.6", "2.2", "2.3", "3.01", "4.10", "4.21"]


def number(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


@each("version", VERSIONS)
def test_simulated_old_hand_control_lacks_later_commands(version: str) -> None:
    for name, request, since, _ in forms():
        bench = Bench("cge", version)
        if number(version) >= number(since):
            assert bench(typed(request)).endswith(b"#")
        elif name.startswith("rtc_set") and number(version) >= (1, 6):
            assert bench(typed(request)) == b"\0#"
        else:
            assert bench(typed(request) + b"Kz") == b"z#"


def test_simulator_knows_later_commands_only_from_their_version_on() -> None:
    for letter, since in ((b"v", "2.2"), (b"l", "4.12"), (b"p", "4.15"), (b"x", "4.21"), (b"u", "5.29")):
        for version in (*VERSIONS, "4.12", "4.15", "5.31"):
            assert bool(Bench("cgem", version)(letter)) == (number(version) >= number(since))
    assert Bench("cgem")(b"v") == b"\x11#"
    assert Bench("cgem", "5.31", utc_offset=5.75)(b"i")[6:] == b"\x17\0#"
    quarters = b"\x0f\x1a\x00\x04\x06\x05\xec\x01"
    assert Bench("cgem", "5.31")(b"I" + quarters + b"i") == b"#" + quarters + b"#"


# --- models ------------------------------------------------------------------------------------------------


def test_every_command_of_the_celestron_manual_has_a_simulator_handler() -> None:
    known = load("nexstar").commands
    assert {name for name, command in known.items() if not command.beyond} <= set(HANDLERS) <= set(known)


def test_simulated_hand_control_ignores_a_command_without_a_handler(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench("cpc", "4.21")
    assert bench(b"P\x01\xb0\x37\0\0\0\x01") == b"\x01#"
    monkeypatch.delitem(HANDLERS, "gps_linked")
    monkeypatch.delitem(HANDLERS, "J")
    assert bench(b"P\x01\xb0\x37\0\0\0\x01") == b"\0\0#" and bench(b"J") == b""


@each("model", list(load("nexstar").models))
def test_simulated_hand_control_has_only_the_gps_and_rtc_of_its_model(model: str) -> None:
    bench, row = Bench(model, "4.21"), load("nexstar").models[model]
    assert bench(b"m") == bytes((row["id"],)) + b"#"
    assert (bench("50 01 B0 37 00 00 00 01") == b"\0\0#") == ("gps" not in row["has"])
    assert (bench("50 01 B0 FE 00 00 00 02") == ABSENT) == ("gps" not in row["has"])
    assert (bench("50 01 B2 03 00 00 00 02") == ABSENT) == ("rtc" not in row["has"])
    assert (bench("50 03 B2 83 04 06 00 00") == b"\0#") == ("rtc" not in row["has"])
    assert (bench("50 01 10 0B 00 00 00 00") == b"\0#") == ("home" not in row["has"])
    assert (bench("50 02 10 0D 01 00 00 00") == b"\0#") == ("pec" not in row["has"])
    for device in ("10", "11"):
        major, minor = row["motors"].split(".")
        assert bench(f"50 01 {device} FE 00 00 00 02") == bytes((int(major), int(minor))) + b"#"
        for command in ("81", "82", "83", "84", "30", "31", "C8"):
            assert bench(f"50 01 {device} {command} 00 00 00 02") == ABSENT
    assert bench("50 01 12 FE 00 00 00 02") == ABSENT
    assert bench("50 01 B2 81 00 00 00 02") == ABSENT
    assert bench(b"t") == (b"\x02#" if row["mount"] == "german" else b"\x01#")


def test_simulated_gt_reports_version_101_as_byte_101() -> None:
    old, new = Bench("gt", "101.0"), Bench("gt", "104.0")
    assert old(b"V") == b"\x65\x00#" and new(b"V") == b"\x68\x00#"
    assert old(b"e") == b"" and old(b"E") != b""
    assert new(b"e") != b"" and new(b"S0000,0000") != b"#"
    assert new(b"t") == b"\x01#"


def test_simulated_starsense_adds_its_version_to_the_tracking_mode() -> None:
    bench = Bench("6-8se", "starsense-1.20")
    assert bench(b"Vv") == b"\x01\x14#\x13#"
    assert bench(b"J") == b"\x01#"
    assert bench(b"W\x21\x32\x29\x00\x76\x14\x11\x01") == b"#"
    assert bench(b"J") == b"\x00#" and bench(b"t") == b"\x00\x01\x14#"
    assert Bench("6-8se", None, starsense=True)(b"V") == b"\x01\x14#"


@each(("model", "version"), [("cge", "3.01"), ("cge", "3.04"), ("advanced-gt", "3.02")])
def test_simulated_early_german_versions_shift_the_tracking_modes(model: str, version: str) -> None:
    bench = Bench(model, version)
    assert bench(b"t") == b"\x01#"
    bench(b"T\x02")
    assert bench(b"t") == b"\x02#" and bench.sim.mode == 3
    bench(b"T\x03")
    assert bench.sim.mode == 3
    bench(b"T\x00")
    assert bench(b"t") == b"\x00#"
    assert Bench("cge", "4.10")(b"t") == b"\x02#"


def test_unknown_nexstar_model_or_version_is_refused() -> None:
    for model, version in (("lx200", "4.21"), ("cge", "four"), ("cge", "4"), ("cge", "moonsense-1.20")):
        with pytest.raises(UserError):
            Bench(model, version)


# --- behaviour ---------------------------------------------------------------------------------------------


def test_simulated_unaligned_hand_control_ignores_sky_gotos_but_takes_axis_gotos() -> None:
    bench = Bench(aligned=False)
    assert bench(b"J") == b"\x00#" and bench(b"t") == b"\x00#"
    assert bench(b"z") == b"00000000,00000000#"
    assert bench(b"T\x01") == b"#" and bench(b"t") == b"\x00#"
    before = bench(b"z")
    assert bench(b"r35555555,20000000") == b"#" and bench(b"L") == b"0#"
    assert bench(b"s35555555,20000000") == b"#"
    assert bench.after(60)(b"z") == before
    assert bench(b"b20000000,10000000") == b"#" and bench(b"L") == b"1#"
    assert bench.settle()(b"z") == b"20000000,10000000#"
    assert re.fullmatch(rb"[0-9A-F]{8},[0-9A-F]{8}#", bench(b"e"))


def test_simulated_fork_silently_ignores_gotos_beyond_its_limits() -> None:
    bench = Bench(site=(45.0, 10.0))
    before = bench(b"z")
    ra = round((sidereal_time(bench.now, 10.0) + 180) / 360 * 2**32) % 2**32
    assert bench(b"r%08X,00000000" % ra) == b"#" and bench(b"L") == b"0#"
    assert bench(b"B4000,E000") == b"#" and bench(b"L") == b"0#"
    assert bench(b"B4000,4100") == b"#" and bench(b"L") == b"0#"
    assert bench(b"z") == before
    assert bench(b"B4000,4000") == b"#" and bench(b"L") == b"1#"


@each(("latitude", "west", "mode"), [(45.0, "24", 2), (-34.0, "25", 3)])
def test_simulated_german_motors_turn_west_and_north_by_pier_side(latitude: float, west: str, mode: int) -> None:
    bench = Bench("cge", site=(latitude, 10.0), ramps=False)
    assert bench(b"t") == bytes((mode,)) + b"#"
    for hour_angle, side in ((30.0, "E"), (-30.0, "W")):
        ra = (sidereal_time(bench.now, 10.0) - hour_angle) % 360
        bench(b"r%08X,%08X" % (round(ra / 360 * 2**32), round(latitude / 3 / 360 * 2**32) % 2**32))
        bench.settle()
        letter = bench(b"p").decode()[0]
        assert letter == (side if latitude > 0 else {"E": "W", "W": "E"}[side])  # told the northern way
        start = bench.sim.true_position()
        bench(b"T\x00")
        bench(f"50 02 10 {west} 07 00 00 00")
        bench.after(2)
        bench("50 02 10 24 00 00 00 00")
        assert wrap180(bench.sim.true_position()[0] - start[0]) < -1.9
        bench("50 02 11 24 07 00 00 00")
        bench.after(2)
        bench("50 02 11 24 00 00 00 00")
        north = bench.sim.true_position()[1] - start[1]
        assert north == pytest.approx(2.0 if side == "E" else -2.0, abs=1e-6)
        bench(bytes((0x54, mode)))


def test_simulated_pier_side_letters_swap_in_the_south_from_5_28_on() -> None:
    bench = Bench("cgem", "5.31", site=(-34.0, 10.0))
    ra = (sidereal_time(bench.now, 10.0) - 30) % 360
    bench(b"r%08X,F0000000" % round(ra / 360 * 2**32))
    assert bench.settle()(b"p") == b"E#"


def test_arrow_keys_of_a_simulated_fork_move_in_azimuth_and_altitude() -> None:
    bench = Bench(site=(45.0, 10.0), ramps=False)
    bench(b"T\x00")
    bench("50 02 10 24 07 00 00 00")
    bench("50 02 11 25 07 00 00 00")
    assert bench.after(2)(b"L") == b"0#"
    bench("50 02 10 24 00 00 00 00")
    bench("50 02 11 24 00 00 00 00")
    az, alt = bench(b"Z")[:-1].split(b",")
    assert int(az, 16) * 360 / 65536 == pytest.approx(182, abs=0.01)
    assert int(alt, 16) * 360 / 65536 == pytest.approx(43, abs=0.01)


def test_rate_codes_ffff_to_fffd_make_a_simulated_mount_track() -> None:
    for code, arcseconds in (("FF", 15.041), ("FE", 15.0), ("FD", 14.685)):
        bench = Bench("cge", site=(45.0, 10.0))
        bench(b"T\x00B2000,2000")
        bench.settle()
        before = bench.sim.mechanics.axes(bench.now)[0]
        assert bench(f"50 03 10 06 FF {code} 00 00") == b"#"
        assert bench.sim.tracking and bench(b"t") == b"\x00#"
        turned = bench.after(100).sim.mechanics.axes(bench.now)[0] - before
        assert turned * 36 == pytest.approx(arcseconds, abs=0.001)
        bench("50 03 10 06 00 00 00 00")
        assert not bench.sim.tracking


def test_simulated_variable_rates_turn_the_axes_at_that_rate() -> None:
    bench = Bench(site=(45.0, 10.0), ramps=False)
    bench(b"T\x00")
    bench("50 03 10 06 02 58 00 00")  # 150 arcseconds a second
    bench("50 04 11 07 02 58 00 00")  # the same in the finer form, downwards
    first, second = bench.after(10).sim.mechanics.axes(bench.now)
    assert ((first - 180) * 360, (second - 45) * 360) == pytest.approx((150, -150))


def test_simulated_tracking_resumes_after_a_hand_motion() -> None:
    """By ``T``, after a goto, after 20 s of silence; in alt-az after 30 s in any case."""
    bench = Bench("cge")
    bench("50 02 10 24 09 00 00 00")
    bench.after(1)("50 02 10 24 00 00 00 00")
    for _ in range(60):
        assert bench.after(1)(b"t") == b"\x02#"
        assert not bench.sim.tracking
    bench(b"T\x02")
    assert bench.sim.tracking
    bench("50 02 10 25 09 00 00 00")
    bench.after(1)("50 02 10 24 00 00 00 00")
    assert not bench.after(19).sim.tracking
    assert bench.after(1.1).sim.tracking
    fork = Bench()
    fork("50 02 11 24 06 00 00 00")
    fork.after(1)("50 02 11 24 00 00 00 00")
    assert [fork.after(10)(b"L") and fork.sim.tracking for _ in range(3)] == [False, False, True]


def test_simulated_clock_runs_on_from_the_time_that_was_set() -> None:
    bench = Bench("cpc", aligned=False)
    bench(b"H\x17\x3b\x3b\x0c\x1f\x18\x05\x00")
    assert bench.after(2)(b"h") == b"\x00\x00\x01\x01\x01\x19\x05\x00#"
    assert bench("50 01 B0 33 00 00 00 03") == b"\x13\x1a\x02#"
    west = sidereal_time(1735671601.0, MANUAL_SITE[1])
    assert int(bench(b"l")[:8], 16) * 360 / 2**32 == pytest.approx(west, abs=1e-4)


def test_simulated_real_time_clock_is_set_in_parts() -> None:
    bench = Bench("cge")
    bench("50 03 B2 84 07 EA 00 00")
    bench("50 03 B2 83 01 0F 00 00")
    bench("50 04 B2 B3 16 00 00 00")
    assert bench("50 01 B2 04 00 00 00 02") == b"\x07\xea#"
    assert bench("50 01 B2 03 00 00 00 02") == b"\x01\x0f#"
    assert bench.after(61)("50 01 B2 33 00 00 00 03") == b"\x16\x01\x01#"
    assert bench("50 03 B2 83 0D 0F 00 00") == b"#"
    assert bench("50 01 B2 03 00 00 00 02") == b"\x01\x0f#"


def test_simulated_fork_does_not_run_away_after_a_tracking_code() -> None:
    bench = Bench(site=(45.0, 10.0))
    before = bench.sim.mechanics.axes(bench.now)
    bench("50 03 10 06 FF FF 00 00")
    after = bench.after(10).sim.mechanics.axes(bench.now)
    assert (after[0] - before[0]) * 3600 == pytest.approx(150.4, abs=0.1)


_BYTES = st.one_of(
    st.binary(max_size=30),
    st.binary(min_size=4, max_size=4).map(lambda data: b"P\x02\x10\x24" + data),
    st.tuples(st.integers(0, 5), st.sampled_from([16, 17, 18, 176, 178]), st.binary(min_size=5, max_size=5)).map(
        lambda parts: bytes((80, parts[0], parts[1])) + parts[2]
    ),
    st.binary(min_size=8, max_size=8).map(lambda data: b"W" + data),
    st.binary(min_size=8, max_size=8).map(lambda data: b"H" + data),
    st.tuples(st.sampled_from("rbs"), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)).map(
        lambda parts: b"%s%08X,%08X" % (parts[0].encode(), *parts[1:])
    ),
    st.integers(0, 255).map(lambda mode: bytes((84, mode))),
)


@some
@given(
    st.sampled_from(["6-8se", "cge", "cgx", "nexstar-gps"]),
    st.sampled_from([-90.0, -34.0, 0.0, 45.0, 90.0]),
    st.booleans(),
    st.lists(st.tuples(_BYTES, st.floats(0, 1e5)), max_size=30),
)
def test_no_bytes_break_the_simulated_hand_control(
    model: str, latitude: float, aligned: bool, story: list[tuple[bytes, float]]
) -> None:
    bench = Bench(model, site=(latitude, 10.0), aligned=aligned, focuser=True)
    for data, wait in story:
        bench(data)
        bench.after(wait)
        ra, dec = bench.sim.true_position()
        assert 0 <= ra < 360 and -90 <= dec <= 90
    bench.after(2)
    assert bench(b"yKz").endswith(b"z#")
    assert len(bench(b"ez")) == 36


def test_simulated_hibernating_hand_control_is_silent_until_it_wakes() -> None:
    bench = Bench()
    assert bench(b"x") == b"#"
    assert bench(b"eztJLMmwhTPRPRPRP") == b""
    bench.after(2)
    assert bench(b"KxV") == b"x#\x04\x15#"
    assert not bench.sim.tracking
    assert bench(b"y1") == b"#"
    assert bench.sim.tracking and bench(b"t") == b"\x01#"


def test_simulated_axis_commands_move_and_set_one_axis() -> None:
    bench = Bench("cge", site=(45.0, 10.0))
    bench(b"T\x00")
    assert bench("50 01 11 01 00 00 00 03") == b"\x40\x00\x00#"
    assert bench("50 04 11 02 30 00 00 00") == b"#"
    assert bench("50 01 11 13 00 00 00 01") == b"\x00#"
    assert bench("50 01 10 13 00 00 00 01") == b"\xff#"
    assert bench(b"L") == b"1#"
    assert bench.settle()("50 01 11 01 00 00 00 03") == b"\x30\x00\x00#"
    assert bench("50 04 10 17 48 00 00 00") == b"#"
    assert bench.settle()("50 01 10 01 00 00 00 03") == b"\x48\x00\x00#"
    truth, believed = bench.sim.true_position(), bench.place()
    assert bench("50 04 11 04 28 00 00 00") == b"#"
    assert bench("50 01 11 01 00 00 00 03") == b"\x28\x00\x00#"
    assert bench.sim.true_position() == pytest.approx(truth)
    assert bench.place()[1] == pytest.approx(believed[1] - 11.25, abs=1e-4)
    bench(b"B4000,3000")
    assert bench.settle()(b"Z") == b"4000,3000#"


def test_simulated_motor_settings_stay_within_their_ranges() -> None:
    bench = Bench("cgem")
    assert bench("50 02 10 46 40 00 00 00") == b"#"
    assert bench("50 01 10 47 00 00 00 01") == b"\x40#"
    assert bench("50 01 11 47 00 00 00 01") == b"\x80#"
    assert bench("50 02 11 10 32 00 00 00") == b"#"
    assert bench("50 02 11 10 64 00 00 00") == b"#"
    assert bench("50 01 11 40 00 00 00 01") == b"\x32#"
    assert bench("50 01 11 41 00 00 00 01") == b"\x00#"
    assert bench("50 01 B4 10 00 00 00 01") == b"\0\0#"
    assert bench("50 01 10 FE 00 00 00 04") == b"\x06\x10\0\0#"
    assert bench("50 01 10 FE 00 00 00 01") == b"\x06#"


def test_simulated_axes_find_their_home_switches() -> None:
    bench = Bench("cgx", "5.31")
    bench(b"T\x00b10000000,10000000")
    bench.settle()
    for axis in ("10", "11"):
        assert bench(f"50 01 {axis} 0B 00 00 00 00") == b"#"
        assert bench(f"50 01 {axis} 12 00 00 00 01") == b"\x00#"
    bench.settle()
    assert bench("50 01 10 12 00 00 00 01") == b"\xff#"
    assert bench(b"z") == b"40000000,40000000#"


def test_simulated_focuser_answers_only_where_one_is_connected() -> None:
    bench = Bench(focuser=True)
    assert len(bench("50 01 12 FE 00 00 00 02")) == 3
    assert bench("50 01 12 01 00 00 00 03") == b"\x00\x61\xa8#"
    assert bench("50 02 12 24 09 00 00 00") == b"#"
    bench.after(2)
    assert bench("50 02 12 24 00 00 00 00") == b"#"
    assert bench.after(5)("50 01 12 01 00 00 00 03") == b"\x00\x69\x78#"
    assert bench("50 04 12 02 00 61 A8 00") == b"#"
    assert bench("50 01 12 13 00 00 00 01") == b"\x00#"
    assert bench.after(3)("50 01 12 13 00 00 00 01") == b"\xff#"
    assert bench("50 02 12 25 09 00 00 00") == b"#"
    assert bench.after(99)("50 01 12 01 00 00 00 03") == b"\0\0\0#"
    assert bench("50 01 12 2C 00 00 00 08") == bytes(9) + b"#"
