"""Values out of range are refused and change nothing; sixty carries where programs send it.

The bytes are the manual's forms, typed by hand, each with a value that its field cannot have.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.mount.policy import Limits
from tests.support.each import each
from tests.support.fake_mount import Talk

MODELS = ["autostar", "lx200", "lx200-16", "lx200gps"]
WITH_HORIZON = ["autostar", "lx200-16", "lx200gps"]


@each("model", MODELS)
@each(
    "bad",
    [
        b":So91#", b":Sh91#", b":So99*#", b":Sh-5#", b":So-5#", b":So-05*#", b":Sh100#", b":Sh540#", b":Sh5401#",
        b":So-5400#", b":So#", b":Sh45.5.5#", b":Shab#",
    ],
)  # fmt: skip
def test_lx200_altitude_limit_accepts_0_to_90_degrees(model: str, bad: bytes) -> None:
    talk = Talk(model=model)
    assert talk.send(b":So10*#:Sh80#") == b"11"
    assert talk.send(bad) == b"0"
    assert talk.send(b":Go#:Gh#") == b"10*#80*#"


def test_four_digits_of_an_lx200_limit_are_read_as_arcminutes() -> None:
    assert Talk().send(b":So00#:Sh5400#:Go#:Gh#") == b"1100*#90*#"
    assert Talk().send(b":So0600#:Sh4800#:Go#:Gh#") == b"1110*#80*#"


@each(
    "bad",
    [
        b":Srab:cd:ef#", b":Srxx:yy:zz#", b":Sdab*cd:ef#", b":SLab:cd:ef#", b":Sgab*cd#", b":Stab*cd#",
        b":SCab/cd/ef#", b":SGab#",
    ],
)  # fmt: skip
def test_lx200_setter_with_letters_for_digits_is_answered_by_one_0(bad: bytes) -> None:
    """A program waits for its one character."""
    talk = Talk()
    assert talk.send(bad) == b"0"
    talk.wait(0.2)
    assert talk.send(b":GR#") == b"12:34:56#"


@each(
    ("said", "asked", "told"),
    [
        (b":Sr12:34:60#", b":Gr#", b"12:35:00#"),
        (b":Sr12:59:60#", b":Gr#", b"13:00:00#"),
        (b":Sr12:60:00#", b":Gr#", b"13:00:00#"),
        (b":Sr12:60.0#", b":Gr#", b"13:00:00#"),
        (b":Sr23:59:60#", b":Gr#", b"00:00:00#"),
        (b":Sd+45*60#", b":Gd#", b"+46*00:00#"),
        (b":Sd+45*59:60#", b":Gd#", b"+46*00:00#"),
        (b":Sd-45*59:60#", b":Gd#", b"-46*00:00#"),
        (b":Sd-00*60#", b":Gd#", b"-01*00:00#"),
        (b":SL12:34:60#", b":GL#", b"12:35:00#"),
        (b":SL12:60:00#", b":GL#", b"13:00:00#"),
    ],
)
def test_sixty_carries_over_in_lx200_targets_and_times(said: bytes, asked: bytes, told: bytes) -> None:
    """As INDIGO rounds, and Hamlib: the mount goes where the program meant."""
    talk = Talk()
    assert talk.send(b":Sr05:00:00#:Sd+20*00:00#") == b"11"
    assert talk.send(said + asked) == b"1" + told
    assert talk.send(b":MS#") != b"1No target set.#"


def test_sixtieth_second_of_a_day_is_read_as_the_next_midnight() -> None:
    talk = Talk()
    assert talk.send(b":SC03/22/26#")[:1] == b"1"
    assert talk.send(b":SL23:59:60#:GC#:GL#") == b"103/23/26#00:00:00#"


@each("bad", [b":SL12:34:61#", b":SL12:99:00#", b":SL24:00:00#", b":SL23:60:60#", b":SL-12:00:00#"])
def test_impossible_lx200_time_is_refused(bad: bytes) -> None:
    talk = Talk()
    assert talk.send(b":GL#") == b"20:15:30#"
    assert talk.send(bad) == b"0"
    talk.wait(5.0)
    assert talk.send(b":GL#") == b"20:15:35#"


@each("bad", [b":Sz-10*00#", b":Sz+10*00#", b":Sh85.5#", b":Sh+85#", b":So10.5*#", b":SF21.5#", b":SB1.5#", b":SB+1#"])
def test_unexpected_sign_or_decimals_in_an_lx200_number_are_refused(bad: bytes) -> None:
    talk = Talk(model="lx200gps")
    assert talk.send(b":So10*#:Sh80#") == b"11"
    assert talk.send(bad) == b"0"
    assert talk.send(b":Go#:Gh#") == b"10*#80*#"


@each("model", WITH_HORIZON)
def test_sixty_arcminutes_carry_over_in_lx200_alt_az_and_site(model: str) -> None:
    talk = Talk(model=model)
    assert talk.send(b":Sz 179*60#:Sa+29*60#:MA#") == b"110"
    assert talk.mount.asked[-1].az == 180.0  # type: ignore[attr-defined]
    assert talk.mount.asked[-1].alt == 30.0  # type: ignore[attr-defined]
    assert talk.send(b":Sg074*60#:St40*60#:Gg#:Gt#") == b"11+075*00#+41*00#"


@each("bad", [b":Sz180*61#", b":Sz180*99#", b":Sa+30*61#", b":Sg074*61#", b":Sg074*99#", b":St+40*61#", b":St+40*99#"])
def test_sixty_one_is_refused_as_minutes_or_seconds(bad: bytes) -> None:
    talk = Talk()
    assert talk.send(b":Sg074*30#:St+40*45#") == b"11"
    assert talk.send(bad) == b"0"
    assert talk.send(b":Gg#:Gt#") == b"+074*30#+40*45#"


@each("bad", [b":Se+181*00#", b":Se-181*00#", b":Se+360*00#", b":Se+200*00#", b":SE+91*00#"])
def test_lunar_coordinates_beyond_the_moon_are_refused(bad: bytes) -> None:
    talk = Talk()
    assert talk.send(b":SE+20*00#:Se-010*30#") == b"11"
    assert talk.send(bad) == b"0"
    assert talk.send(b":MS#")[:1] == b"1"


# --- numbers that nobody can have meant -------------------------------------------------------------------------------

#: Each numeric setter: the form, what is taken at both ends, what is refused, and the reply to both. Hamlib's :Sh5400#
#: (90 degrees in minutes) is taken, see above.
SETTERS = [
    ("ST", [b":ST50.0#", b":ST70.0#"], [b":ST1#", b":ST49.9#", b":ST70.1#", b":ST99.9#", b":ST000.0#"], (b"1", b"0")),
    ("T", [b":T050.000#", b":T070.000#"], [b":T001.000#", b":T070.100#"], (b"1", b"0")),
    ("Rg", [b":Rg00.1#", b":Rg30.1#"], [b":Rg30.2#", b":Rg99.9#"], (b"", b"")),
    ("RA", [b":RA00.1#:Me#", b":RA20.0#:Me#"], [b":RA20.1#", b":RA99.9#"], (b"", b"")),
    ("RE", [b":RE00.1#:Mn#", b":RE20.0#:Mn#"], [b":RE20.1#", b":RE99.9#"], (b"", b"")),
    ("SG", [b":SG-14.0#", b":SG+12.0#"], [b":SG-14.5#", b":SG+25.0#"], (b"1", b"0")),
    ("Sw", [b":Sw2#", b":Sw8#"], [b":Sw0#", b":Sw9#"], (b"1", b"0")),
    ("SB", [b":SB1#", b":SB9#"], [b":SB0#", b":SB10#", b":SBabc#", b":SB#", b":SB-1#", b":SBz#"], (b"1", b"0")),
    ("Sf", [b":Sf-05.5#", b":Sf+20.0#"], [b":Sf+30.1#", b":Sf-40.0#"], (b"1", b"0")),
    ("St", [b":St-90*00#", b":St+90*00#"], [b":St+90*01#", b":St-91*00#"], (b"1", b"0")),
    ("Sg", [b":Sg000*00#", b":Sg360*00#"], [b":Sg360*01#", b":Sg999*00#"], (b"1", b"0")),
]


@each(("name", "good", "bad", "replies"), SETTERS)
def test_lx200_number_out_of_range_is_refused(
    name: str, good: list[bytes], bad: list[bytes], replies: tuple[bytes, bytes]
) -> None:
    for one in good:
        assert Talk(model="lx200gps").send(one) == replies[0], one
    for one in bad:
        talk = Talk(model="lx200gps")
        before = len(talk.mount.asked)
        assert talk.send(one) == replies[1], one
        assert len(talk.mount.asked) == before, one


# --- the altitude of a target -------------------------------------------------------------------------------------


@each("model", WITH_HORIZON)
@each("out", [b":Sa-10*00#", b":Sa+95*00#", b":Sa-00*10#"])
def test_altitude_outside_the_slew_range_is_refused_and_selects_nothing(model: str, out: bytes) -> None:
    talk = Talk(model=model)
    assert talk.send(b":Sz180*00#:Sa+30*00#") == b"11"
    assert talk.send(out) == b"0"
    assert talk.send(b":MA#") == b"1"
    assert not talk.mount.slewing


def test_altitude_beyond_the_clients_limits_is_refused() -> None:
    talk = Talk()
    assert talk.send(b":So20*#:Sh70#:Sa+19*50#:Sa+20*00#:Sa+70*00#:Sa+70*10#") == b"110110"


def test_altitude_below_the_configured_limit_is_refused() -> None:
    talk = Talk()
    talk.session.client_settings = replace(talk.session.client_settings, limits=Limits(lowest=-5.0))
    assert talk.send(b":Sa-04*00#:Sa-06*00#") == b"10"


# --- small commands without a reply ----------------------------------------------------------------------------------


def test_invalid_lx200_focus_speed_keeps_the_earlier_one() -> None:
    talk = Talk(model="lx200gps")
    assert talk.send(b":F3#:F0#:F5#:F9#:F+#") == b""
    assert talk.mount.asked[-1].speed == 3  # type: ignore[attr-defined]


# --- a client that only looks ----------------------------------------------------------------------------------------


def test_lx200_limits_that_leave_no_range_are_refused() -> None:
    """The manual's text has the two the other way round: a program that goes by it would lock itself out."""
    talk = Talk()
    assert talk.send(b":Sh00#:Gh#") == b"090*#"
    assert talk.send(b":So85*#:Sh10#:So85*#") == b"101"
    assert talk.send(b":Go#:Gh#") == b"85*#90*#"
