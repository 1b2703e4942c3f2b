"""Sites and their names. Meade's longitudes count west positive, the operations' count east positive."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.core import operations as op
from tests.support.each import each
from tests.support.examples import some
from tests.support.fake_mount import Talk


def _place(talk: Talk) -> tuple[Any, Any]:
    """The last halves that were set: latitude, longitude; None where none was."""
    sites = talk.mount.of(op.SetSite)
    return (
        next((site.latitude for site in reversed(sites) if site.latitude is not None), None),
        next((site.longitude for site in reversed(sites) if site.longitude is not None), None),
    )


@each(
    ("sent", "east", "told"),
    [
        (b"122*25", -(122 + 25 / 60), b"+122*25#"),
        (b"+122*25", -(122 + 25 / 60), b"+122*25#"),
        (b"003*08'", -(3 + 8 / 60), b"+003*08#"),
        (b"312*00", 48.0, b"-048*00#"),
        (b"-48*00", 48.0, b"-048*00#"),
        (b"-048*00:00", 48.0, b"-048*00#"),
        (b"351*40", 8 + 20 / 60, b"-008*20#"),
        (b"-000*30", 0.5, b"-000*30#"),
        (b"359*30", 0.5, b"-000*30#"),
        (b"000*30", -0.5, b"+000*30#"),
        (b"000*00", 0.0, b"+000*00#"),
        (b"360*00", 0.0, b"+000*00#"),
        (b"010:44", -(10 + 44 / 60), b"+010*44#"),
        (b" 122\xdf25", -(122 + 25 / 60), b"+122*25#"),
    ],
)
def test_lx200_longitude_is_converted_from_west_positive(sent: bytes, east: float, told: bytes) -> None:
    talk = Talk()
    assert talk.send(b":Sg%s#:Gg#" % sent) == b"1" + told
    assert _place(talk) == (None, pytest.approx(east))


@some
@given(st.integers(0, 21599))
def test_signed_and_unsigned_lx200_longitudes_mean_the_same_place(west: int) -> None:
    """In arcminutes; a longitude of 180 degrees has two signs."""
    unsigned = b"%03d*%02d" % divmod(west, 60)
    signed = (b"-%03d*%02d" % divmod(21600 - west, 60)) if west > 10800 else b"+" + unsigned
    one, other = Talk(), Talk()
    assert one.send(b":Sg%s#:Gg#" % unsigned) == other.send(b":Sg%s#:Gg#" % signed) == b"1" + signed + b"#"
    assert _place(one)[1] == pytest.approx(_place(other)[1])


@some
@given(st.integers(-5400, 5400))
def test_lx200_latitude_is_set_and_reported(north: int) -> None:
    text = b"%s%02d*%02d" % (b"-" if north < 0 else b"+", *divmod(abs(north), 60))
    talk = Talk()
    assert talk.send(b":St%s#:Gt#" % text) == b"1" + text + b"#"
    assert _place(talk) == (pytest.approx(north / 60), None)


@each("refused", [b":St+91*00#", b":St+90*01#", b":St#", b":Stabc#", b":Sg361*00#", b":Sg-181*00#", b":Sg#"])
def test_impossible_lx200_site_is_refused(refused: bytes) -> None:
    talk = Talk()
    assert talk.send(refused) == b"0"
    assert talk.mount.asked == []
    assert talk.session.shared.sites == {}


# --- four named sites ---------------------------------------------------------------------------------------------


@each(("model", "longest"), [("autostar", 15), ("lx200", 3), ("lx200-16", 3), ("lx200gps", 15)])
def test_lx200_site_name_is_cut_to_the_models_length_and_saved(model: str, longest: int) -> None:
    talk, saved = Talk(model=model), []
    talk.session.shared_settings.changed = lambda: saved.append(1)
    name = b"Observatory Alpha"[:longest]
    for letter in (b"M", b"N", b"O", b"P"):
        assert talk.send(b":S%s%s#:G%s#" % (letter, name, letter)) == b"1" + name + b"#"
    assert talk.send(b":SM%sX#:SM#:SM  #:GM#" % name) == b"000" + name + b"#"
    assert len(saved) == 4


def test_all_lx200_clients_read_the_same_nonempty_site_names() -> None:
    one, other = Talk(), Talk()
    other.session.shared_settings = one.session.shared_settings
    assert one.send(b":SNHOME#") == b"1"
    assert other.send(b":GN#") == b"HOME#"
    assert all(
        len(Talk(model=model).send(b":G%s#" % letter)) > 1
        for model in ("autostar", "lx200")
        for letter in (b"M", b"N", b"O", b"P")
    )


@each(
    ("model", "names"),
    [("autostar", b"SITE 1#SITE 2#SITE 3#SITE 4#"), ("lx200", b"ST1#ST2#ST3#ST4#"), ("lx200-16", b"ST1#ST2#ST3#ST4#")],
)
def test_unnamed_lx200_sites_can_be_told_apart(model: str, names: bytes) -> None:
    assert Talk(model=model).send(b":GM#:GN#:GO#:GP#") == names


@each(("model", "numbers"), [("autostar", b"0123"), ("lx200-16", b"0123"), ("lx200", b"1234"), ("lx200gps", b"1234")])
def test_selecting_a_stored_lx200_site_sets_it(model: str, numbers: bytes) -> None:
    talk = Talk(model=model)
    for index, number in enumerate(numbers):
        talk.send(b":W%c#:St+4%d*30#:Sg01%d*15#" % (number, index, index))
    talk.mount.asked.clear()
    for index, number in enumerate(numbers):
        assert talk.send(b":W%c#" % number) == b""
        assert talk.send(b":Gt#:Gg#") == b"+4%d*30#+01%d*15#" % (index, index)
    assert len(talk.mount.of(op.SetSite)) == 4
    first = talk.mount.of(op.SetSite)[0]
    assert first.latitude == pytest.approx(40.5)
    assert first.longitude == pytest.approx(-10.25)


def test_site_zero_selects_the_first_site_where_numbers_start_at_one() -> None:
    talk = Talk(model="lx200gps")
    talk.send(b":W1#:St+40*30#:Sg010*15#:W2#:St+50*00#:Sg020*00#")
    talk.send(b":W0#")
    assert talk.send(b":Gt#:Gg#") == b"+40*30#+010*15#"


@each(("model", "command"), [("autostar", b":W1#"), ("autostar", b":W4#"), ("lx200gps", b":W9#")])
def test_selecting_an_unknown_lx200_site_changes_nothing(model: str, command: bytes) -> None:
    talk = Talk(model=model)
    assert talk.send(command + b":Gt#:Gg#") == b"+37*17#+122*25#"
    assert talk.mount.of(op.SetSite) == []
