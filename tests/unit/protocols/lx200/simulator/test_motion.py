"""How the simulated Meades move: tracking rates, arrows, guiding, slews, parking and home."""

from __future__ import annotations

import pytest

from gateway.astro.spherical import SIDEREAL_RATE, separation, wrap180
from gateway.protocols.mechanics.truth import truth_of
from tests.support.each import each
from tests.support.simulated_meade import MODELS, SITES, meade, overhead

ARCSECOND = 1.0 / 3600.0


# --- tracking -----------------------------------------------------------------------------------------------------


@each("site", SITES)
@each("model", MODELS)
def test_simulated_meade_tracks_at_the_documented_rates(model: str, site: tuple[float, float]) -> None:
    """Arcseconds that right ascension grows by in an hour: the Sun's 148 and the Moon's 1281."""
    for command, drift in ((b":TQ#", 0.0), (b":TS#", 147.8), (b":TL#", 1281.0), (b":TM#", 0.0)):
        sim, clock = meade(model, site)
        sim.feed(command)
        before = sim.true_position()
        clock.now += 3600
        after = sim.true_position()
        assert wrap180(after[0] - before[0]) / ARCSECOND == pytest.approx(drift, abs=1.0), command
        assert after[1] == pytest.approx(before[1], abs=ARCSECOND)
        sim.feed(b":TQ#")
        clock.now += 3600
        assert separation(*sim.true_position(), *after) < ARCSECOND


def test_simulated_meade_keeps_its_tracking_rate_after_a_slew() -> None:
    sim, clock = meade("lx200")
    assert sim.feed(b":U#:TS#" + overhead(sim) + b":MS#:GT#") == b"11060.0#"
    clock.now += 600
    before = sim.true_position()
    clock.now += 3600
    assert wrap180(sim.true_position()[0] - before[0]) / ARCSECOND == pytest.approx(147.8, abs=1.0)


def test_simulated_meade_tracks_at_a_rate_given_in_hertz() -> None:
    classic, _ = meade("lx200")
    assert classic.feed(b":GT#:ST060.0#") == b"60.1#0", "in manual mode only"
    assert classic.feed(b":TM#:ST060.2#:ST056.3#:ST056.4#:GT#") == b"00156.4#"
    assert classic.feed(b":T-#:GT#:T+#:T+#:GT#") == b"56.4#56.6#"
    assert classic.feed(b":TQ#:T+#:GT#:TM#:GT#") == b"60.1#56.7#"
    gps, _ = meade("lx200gps")
    assert gps.feed(b":GT#:ST057.9#:GT#") == b"+60.0#1+57.9#"


def test_simulated_classic_restarts_tracking_when_given_a_mode() -> None:
    sim, clock = meade("lx200")
    sim.feed(b":U#" + overhead(sim) + b":MS#")
    clock.now += 300
    truth = sim.true_position()
    assert separation(*sim.position(), *truth) < ARCSECOND
    sim.feed(b":AL#:AP#")
    assert separation(*sim.position(), *truth) > 5.0
    assert not sim.aligned
    sim.feed(b":CM#")
    assert separation(*sim.position(), *truth) < ARCSECOND, "a sync says where it is"


@each("model", ["autostar", "lx200gps"])
def test_simulated_autostar_and_lx200gps_switch_tracking_by_mode_letters(model: str) -> None:
    sim, clock = meade(model)
    assert sim.feed(b":AL#:GW#\x06:AA#:GW#\x06") == b"AN1LAT1A"
    before = sim.true_position()
    clock.now += 600
    assert separation(*sim.true_position(), *before) < ARCSECOND


# --- moving -------------------------------------------------------------------------------------------------------


@each("model", ["autostar", "lx200gps"])
@each("site", SITES)
def test_arrows_of_a_simulated_fork_move_in_altitude_and_azimuth(model: str, site: tuple[float, float]) -> None:
    """North and south move in altitude, west with and east against azimuth."""
    for letter, axis, sign in ((b"n", 1, 1), (b"s", 1, -1), (b"w", 0, 1), (b"e", 0, -1)):
        sim, clock = meade(model, site, ramps=False)
        before = sim.mechanics.axes(sim.now)
        sim.feed(b":RM#:M" + letter + b"#")
        clock.now += 3
        sim.feed(b":Q" + letter + b"#")
        assert wrap180(sim.mechanics.axes(sim.now)[axis] - before[axis]) * sign == pytest.approx(6.0, abs=0.1)
        still = sim.true_position()
        clock.now += 600
        assert separation(*sim.true_position(), *still) < ARCSECOND


@each("model", MODELS)
@each("site", SITES)
def test_polar_meade_tracks_once_its_east_key_is_released(model: str, site: tuple[float, float]) -> None:
    """Even if north is still pressed: :Qe halts eastward motion only."""
    sim, clock = meade(model, site)
    sim.feed(b":AP#")
    tracks = truth_of(sim).rate1
    assert abs(tracks) * 3600.0 == pytest.approx(15.041, abs=0.001)
    sim.feed(b":RC#:Mn#:Me#")
    clock.now += 2
    sim.feed(b":Qe#")
    clock.now += 2
    seen = truth_of(sim)
    assert seen.rate1 == pytest.approx(tracks) and abs(seen.rate2) == pytest.approx(16 * SIDEREAL_RATE, rel=0.01)
    sim.feed(b":AL#:Mn#:Me#")
    clock.now += 2
    sim.feed(b":Qe#")
    clock.now += 2
    assert truth_of(sim).rate1 == 0.0


@each("model", MODELS)
def test_simulated_meade_guiding_adds_to_tracking(model: str) -> None:
    sim, clock = meade(model)
    before = sim.true_position()
    sim.feed(b":RG#:Mn#")
    clock.now += 10
    sim.feed(b":Qn#")
    assert separation(*sim.true_position(), *before) / ARCSECOND == pytest.approx(150.4, abs=1.0)
    still = sim.true_position()
    clock.now += 600
    assert separation(*sim.true_position(), *still) < ARCSECOND
    sim.feed(b":Mgs1500#")
    clock.now += 5
    guided = 22.6 if model in ("autostar", "lx200gps") else 0.0
    assert separation(*sim.true_position(), *still) / ARCSECOND == pytest.approx(guided, abs=0.5)


def test_simulated_lx200gps_moves_at_the_commanded_rates() -> None:
    sim, clock = meade("lx200gps", ramps=False)
    sim.feed(b":RS#")
    for command, axis, rate in ((b":RE03.0#:Mn#", 1, 3.0), (b":RA02.0#:Mw#", 0, 2.0), (b":RA00.0#:Mw#", 0, 8.0)):
        before = sim.mechanics.axes(sim.now)
        sim.feed(command)
        clock.now += 2
        sim.feed(b":Q#")
        assert wrap180(sim.mechanics.axes(sim.now)[axis] - before[axis]) == pytest.approx(2 * rate, abs=0.1)
    still = sim.true_position()
    sim.feed(b":Rg07.5#:Mgn2000#")
    clock.now += 10
    assert separation(*sim.true_position(), *still) / ARCSECOND == pytest.approx(15.0, abs=0.5)


@each(("model", "fastest"), [("lx200", 8), ("lx200-16", 4), ("autostar", 8), ("lx200gps", 8)])
def test_simulated_meade_accepts_sw_only_up_to_its_fastest_rate(model: str, fastest: int) -> None:
    sim, _ = meade(model)
    assert sim.feed(f":Sw1#:Sw9#:Sw2#:Sw{fastest}#:Sw{fastest + 1}#".encode()) == b"00110"


def test_simulated_classic_counts_distance_bars_for_each_axis() -> None:
    sim, _ = meade("lx200")
    before = sim.position()
    hours = (before[0] + 30.0) % 360.0 / 15.0
    sim.feed(f":U#:Sr{int(hours):02d}:{int(hours * 60) % 60:02d}:00#:Sd+80*00#:MS#".encode())
    bars = sim.feed(b":D#")
    assert bars == b"\xff" * 3 + b" " * 13 + b"\xff" * 7 + b" " * 9 + b"#"


@each("model", ["autostar", "lx200gps"])
def test_simulated_meade_stops_tracking_when_parked(model: str) -> None:
    sim, clock = meade(model)
    sim.feed(b":hP#")
    assert sim.feed(b":D#") == b"\x7f#"
    clock.now += 120
    assert sim.feed(b":D#:GW#") == b"#ANP"
    assert sim.feed(b":U#:U#:GA#")[:6] in (b"+00\xdf00", b"-00\xdf00")
    sim.feed(overhead(sim) + b":MS#")
    clock.now += 120
    assert sim.feed(b":GW#") == b"AT1"
    if model == "lx200gps":
        sim.feed(b":hN#")
        assert not sim.tracking
        sim.feed(b":hW#")
        assert sim.tracking


def test_parked_polar_meade_points_at_its_pole() -> None:
    for site, pole in ((SITES[0], 90.0), (SITES[1], -90.0)):
        sim, clock = meade("lx200-16", site)
        sim.feed(b":hP#")
        assert sim.feed(b":D#").strip(b" #") != b""
        clock.now += 300
        assert sim.true_position()[1] == pytest.approx(pole)
        assert not sim.tracking


@each(("model", "deaf"), [("lx200-16", b""), ("lx200gps", b"\x15")])
def test_simulated_meade_seeks_and_reports_its_home(model: str, deaf: bytes) -> None:
    sim, clock = meade(model)
    sim.feed(overhead(sim) + b":MS#")
    clock.now += 300
    assert sim.feed(b":hF#:h?#:GR#") == b"2" + deaf
    clock.now += 300
    assert sim.feed(b":h?#") == b"1"
    assert sim.feed(overhead(sim) + b":MS#") == b"110"
    clock.now += 300
    assert sim.feed(b":hS#:Q#:h?#") == b"0", "interrupted"
    assert sim.feed(b":Gc#") == b"24#"


def test_simulated_meade_forgets_target_and_formats_at_a_restart() -> None:
    sim, _ = meade("lx200gps")
    sim.feed(overhead(sim) + b":U#:So10#:SMHOME#:AL#")
    assert sim.feed(b":I#") == b"X"
    assert sim.feed(b":Gr#:Gd#:Go#:GM#") == b"00:00:00#+00\xdf00:00#00\xdf#HOME#"
    assert sim.tracking
