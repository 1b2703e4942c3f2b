"""What the simulated Meades keep and refuse, what takes them time, and how they read their port."""

from __future__ import annotations

import random

import pytest

from gateway.protocols.wireformat.command_set import load
from tests.support.each import each
from tests.support.sampling import as_a_rule
from tests.support.simulated_meade import MODELS, SITES, Line, meade, overhead

# --- what takes its time ------------------------------------------------------------------------------------------


@each("model", ["lx200", "lx200-16"])
def test_simulated_classic_lx200_sends_the_second_date_text_5_seconds_later(model: str) -> None:
    sim, clock = meade(model)
    line = Line(sim)
    assert line.send(b":SC03/20/26#") == b"1Updating        planetary data. #"
    assert line.late == [(5.0, b" " * 32 + b"#")]
    assert line.send(b":GC#") == b""
    clock.now += 5
    assert line.send(b":GC#") == b"03/20/26#"
    assert line.send(b":SC02/30/26#") == b"0"


@each("model", ["autostar", "lx200gps"])
def test_simulated_autostar_and_lx200gps_answer_a_new_date_at_once(model: str) -> None:
    sim, _ = meade(model)
    line = Line(sim)
    assert line.send(b":SC03/20/26#") == b"1Updating Planetary Data#" + b" " * 24 + b"#"
    assert line.late == []


@each(("command", "seconds"), [(b":gT#", 60.0), (b":Aa#", 120.0)])
def test_simulated_lx200gps_says_nak_while_busy(command: bytes, seconds: float) -> None:
    sim, clock = meade("lx200gps")
    line = Line(sim)
    assert line.send(command) == b""
    assert line.late == [(seconds, b"1")]
    assert line.send(b":GR#:D#") == b"\x15\x15"
    assert line.send(b"\x06:Q#") == b"A"
    clock.now += seconds
    assert line.send(b":D#") == b"#"


def test_simulated_lx200gps_answers_gps_and_align_commands_at_once_if_replies_cannot_wait() -> None:
    sim, _ = meade("lx200gps")
    assert sim.feed(b":gT#:Aa#:D#") == b"11#"


def test_simulated_lx200gps_on_a_wedge_does_not_align_itself() -> None:
    sim, _ = meade("lx200gps")
    assert Line(sim).send(b":AP#:Aa#\x06") == b"0P"


def test_simulated_gps_time_is_the_true_time() -> None:
    sim, _ = meade("lx200gps")
    assert sim.feed(b":SL05:00:00#:GL#") == b"105:00:00#"
    assert sim.feed(b":gT#:GL#:GC#") == b"122:00:00#01/15/26#"


def test_simulated_lx200gps_counts_its_date_in_universal_time() -> None:
    sim, _ = meade("lx200gps", utc_offset=5.0)
    assert sim.feed(b":GC#:GL#") == b"01/16/26#03:00:00#"
    sim.feed(b":SC01/15/26#")
    assert sim.feed(b":GC#") == b"01/16/26#"


# --- the port of a classic ----------------------------------------------------------------------------------------


def test_simulated_classic_drops_unreadable_bytes() -> None:
    sim, _ = meade("lx200", tolerant=True)
    assert sim.feed(b":Sd+22\xdf00#") == b""
    assert sim.feed(b":Sd+22*00#") == b"1"
    assert sim.feed(b":G\nR#") == b""
    assert sim.feed(b":Sd+022*000:00.00#") == b""
    assert sim.feed(b":Sr05:34:32.125#") == b"1", "fifteen characters"
    assert sim.feed(b"\xff\n:Gc#\r\n\x06") == b"24#P"
    other, _ = meade("lx200gps")
    assert other.feed(b":Sd+22\xdf00#") == b"1"


def test_half_lx200_commands_of_two_connections_do_not_mix() -> None:
    sim, _ = meade("lx200")
    one, other = Line(sim), Line(sim)
    assert one.send(b":G") == b""
    assert other.send(b":Gc#") == b"24#"
    assert one.send(b"c#") == b"24#"


@pytest.mark.parametrize("model", MODELS)
def test_simulated_meade_survives_any_bytes(model: str) -> None:
    dice = random.Random(model)
    names = [*load("lx200").commands, "", "Xy"]
    for _ in range(as_a_rule(12, whole=30)):
        sim, clock = meade(model, dice.choice([*SITES, (90.0, 0.0), (0.0, 180.0)]), aligned=dice.random() < 0.5)
        line = Line(sim)
        for _ in range(100):
            argument = "".join(dice.choices("0123456789+-*:./ nsDGP\xdf", k=dice.randrange(9)))
            line.send(f":{dice.choice(names)}{dice.choice(('', argument))}#".encode("latin-1"))
            clock.now += dice.choice((0.0, 0.2, 7.0, 3600.0))
            ra, dec = sim.true_position()
            assert 0.0 <= ra < 360.0
            assert -90.0 <= dec <= 90.0
            assert sim.position()[1] <= 90.0


# --- sites and the library ----------------------------------------------------------------------------------------


@each(("model", "first"), [("autostar", 0), ("lx200-16", 0), ("lx200", 1), ("lx200gps", 1)])
def test_simulated_meade_stores_four_sites(model: str, first: int) -> None:
    sim, _ = meade(model)
    sim.feed(f":W{first + 1}#:Sg120*30#:St-10*15#".encode())
    assert b"120\xdf30" in sim.feed(b":Gg#")
    sim.feed(f":W{first}#".encode())
    assert sim.feed(b":Gt#")[:6] == b"+45\xdf00"
    sim.feed(f":W{first + 3}#:W9#:W{first + 1}#".encode())
    assert sim.feed(b":Gt#")[:6] == b"-10\xdf15"


def test_simulated_meade_stores_site_names() -> None:
    classic, _ = meade("lx200")
    assert classic.feed(b":SMLAX#:SNHOME#") == b"10"
    assert classic.feed(b":GM#:GN#") == b"LAX" + b" " * 9 + b"\x02#" + b"ST2" + b" " * 10 + b"#"
    gps, _ = meade("lx200gps")
    assert gps.feed(b":SMIrvine#:GM#") == b"1Irvine#"


def test_simulated_meade_accepts_offsets_of_whole_and_half_hours() -> None:
    for model, zero in (("lx200", b"+0#"), ("autostar", b"+00#")):
        sim, _ = meade(model)
        assert sim.feed(b":GG#") == zero
        assert sim.feed(b":SG-05.5#:GG#") == b"1-05.5#"


@each("model", MODELS)
def test_simulated_meade_finds_library_objects_by_number(model: str) -> None:
    sim, _ = meade(model)
    if not sim.high_precision:
        sim.feed(b":U#")
    sim.feed(b":LM42#")
    found = sim.feed(b":Gr#:Gd#")
    assert found[:5] == b"05:36", "Orion's nebula, of date"
    assert found[9:15] == b"-05\xdf22"
    sim.feed(b":LM99#:LC9999#:LS9999#")
    assert sim.feed(b":Gr#:Gd#") == found, "not found: the target stays"
    if sim.classic:
        assert sim.feed(b":LI#:Lo0#:Lo9#:Ls1#:Ls5#") == b"M42 DIFF NEB#1012"
        sim.feed(b":LF#")
        first = sim.feed(b":LI#")
        sim.feed(b":LN#")
        assert sim.feed(b":LI#") != first
        sim.feed(b":LB#")
        assert sim.feed(b":LI#") == first
    else:
        assert sim.feed(b":LI#:Lf#:Lo9#:Ls9#") == b"M31 EX GAL MAG 3.5 SZ178.0'#0 - Objects found#11"


def test_simulated_meade_refuses_the_moon_below_the_horizon() -> None:
    sim, clock = meade("lx200gps")
    seen = set()
    for _ in range(25):
        answer = sim.feed(b":SE+20*00#:Se-010*30#")
        assert answer in (b"00", b"11")
        seen.add(answer)
        if answer == b"11":
            assert sim.feed(b":MS#:Q#") == b"0", "what is up can be slewn to"
        clock.now += 3600
    assert seen == {b"00", b"11"}


def test_simulated_meade_refuses_goto_beyond_limits_in_words_of_its_model() -> None:
    for model, low, high in (
        ("lx200", b"1Object below    horizon.        #", b"2Object above    higher limit.  #"),
        ("autostar", b"1Object Below Horizon.#", b"2Object Below Higher.#"),
    ):
        sim, _ = meade(model)
        sim.feed(overhead(sim))
        assert sim.feed(b":So85*#:MS#:So00*#:Sh30#:MS#:Sh90#:MS#") == b"1" + low + b"11" + high + b"10"


def test_simulated_meade_rejects_settings_out_of_range() -> None:
    sim, _ = meade("lx200gps")
    assert sim.feed(b":SyGpDcO#:Gy#:SyGALAX#") == b"1GpDcO#0"
    assert sim.feed(b":SS12:00:00#:GS#") == b"112:00:00#"
    assert sim.feed(b":St+91*00#:Sr24:00:00#:SL25:00:00#") == b"000"
