"""A simulated Meade takes what the manual writes, and refuses the rest: drivers are tested against it."""

from __future__ import annotations

import pytest

from gateway.cli import main
from gateway.protocols.lx200.simulator.server import is_well_formed
from tests.support.each import each
from tests.support.manual_files import raw, rows
from tests.support.sent_forms import malformed
from tests.support.simulated_meade import MODELS, meade

#: What is refused, and what tells that nothing has changed.
MALFORMED = [
    (b":Sg-010*45#", b":Gg#"),
    (b":Sg+118*19#", b":Gg#"),
    (b":Sg10*45#", b":Gg#"),
    (b":Sg360*00#", b":Gg#"),
    (b":Sg010*60#", b":Gg#"),
    (b":Sg010 45#", b":Gg#"),
    (b":St45*00#", b":Gt#"),
    (b":St+5*00#", b":Gt#"),
    (b":St+45*60#", b":Gt#"),
    (b":St+91*00#", b":Gt#"),
    (b":SG+8#", b":GG#"),
    (b":SG+08#", b":GG#"),
    (b":SG8.0#", b":GG#"),
    (b":SG+8.0#", b":GG#"),
    (b":Sr5:00:00#", b":Gr#"),
    (b":Sr05:00:60#", b":Gr#"),
    (b":Sr 05:00:00#", b":Gr#"),
    (b":Sr24:00:00#", b":Gr#"),
    (b":Sd20*00:00#", b":Gd#"),
    (b":Sd+20*60#", b":Gd#"),
    (b":Sd+90*01#", b":Gd#"),
    (b":So91*#", b":Go#"),
    (b":So10#", b":Go#"),
    (b":So-5*#", b":Go#"),
    (b":Sh91#", b":Gh#"),
    (b":Sh5400#", b":Gh#"),
    (b":Sh5#", b":Gh#"),
    (b":Sb5#", b":Gb#"),
    (b":SF21#", b":GF#"),
    (b":ST60.1#", b":GT#"),
]


@each("model", MODELS)
@each("said, asked", MALFORMED)
def test_simulated_meade_refuses_forms_outside_the_manual_and_changes_nothing(
    model: str, said: bytes, asked: bytes
) -> None:
    sim, _ = meade(model)
    before = sim.feed(asked)
    assert sim.feed(said) == b"0"
    assert sim.feed(asked) == before
    assert malformed("lx200", [said]) == [said], "typed by another hand, the same"


@each("said", [b":Sw1#", b":Sw10#", b":SB0#", b":SB10#", b":Sz5*00#", b":Sz180*61#", b":Sa30*00#", b":T60.1#"])
def test_simulated_lx200gps_answers_0_to_an_invalid_value(said: bytes) -> None:
    sim, _ = meade("lx200gps")
    assert sim.feed(said) == b"0"


@each("said", [b":F0#", b":F7#", b":$BA5#", b":RA4.0#", b":Rg7.5#", b":BD16#"])
def test_simulated_meade_ignores_a_malformed_command_that_has_no_reply(said: bytes) -> None:
    sim, _ = meade("lx200gps")
    assert sim.feed(said) == b""
    assert not sim.accessories and "custom" not in sim.stored_values


def test_syntax_check_accepts_every_example_of_the_manual() -> None:
    """For the simulators, and for what drivers are held against. The one without a colon is a misprint."""
    for name, example, _, _ in rows("lx200_forms.txt"):
        assert is_well_formed(name, raw(example)), example
        assert malformed("lx200", [raw(example)]) == [] or name == "$Q", example


@each("said", [b":Sg-010*45#", b":SG+8#", b":St45*00#", b":Sh5400#", b":Sr 05:00:00#"])
def test_tolerant_simulated_meade_accepts_settings_outside_the_manual(said: bytes) -> None:
    sim, _ = meade("lx200", tolerant=True)
    assert sim.feed(said) == b"1"


@each("said", [b":Sg350\xdf45#", b":Sd+20\xdf00:00#", b":Sd+20:00:00#"])
def test_simulated_lx200gps_accepts_a_df_byte_or_a_colon_as_degree_sign(said: bytes) -> None:
    """As old and new programs send it to real telescopes; a classic takes no byte above 0x7F."""
    sim, _ = meade("lx200gps")
    assert sim.feed(said) == b"1"


def test_tolerant_setting_is_refused_for_a_mount_other_than_a_meade(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "nexstar:cpc", "--tolerant"]) != 0
    assert "--tolerant is for lx200 mounts" in capsys.readouterr().err
