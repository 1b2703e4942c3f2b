"""OnStepX and TeenAstro as their sources write them, typed by hand: the simulated ones, and what is sent to them."""

from __future__ import annotations

import re
from typing import Any

import pytest

from gateway.protocols.lx200.simulator.controllers import SimulatedController
from gateway.protocols.wireformat.command_set import load
from tests.conformance.test_manual_synscan import fits
from tests.support.each import each
from tests.support.manual_files import raw, rows
from tests.support.simulated_meade import Clock, overhead

AFTER_POWER_ON = {"standby", "home"}


def controller(model: str, state: str = "awake") -> tuple[SimulatedController, Clock]:
    clock = Clock()
    sim = SimulatedController(model, clock=clock, site=(45.0, 10.0), aligned=state not in AFTER_POWER_ON)
    if state not in AFTER_POWER_ON:
        sim.feed(overhead(sim))
    if state == "slews":
        sim.feed(b":MS#")
        clock.now += 2.0
    if state == "parked":
        assert sim.feed(b":hQ#:hP#") == b"11"
        clock.now += 200.0
        sim.feed(b"#")
    return sim, clock


@each("state, sent, reply", rows("onstep_talk.txt"))
def test_simulated_onstep_answers_as_its_sources_say(state: str, sent: str, reply: str) -> None:
    assert fits(controller("onstep", state)[0].feed(raw(sent)), reply)


@each("state, sent, reply", rows("teenastro_talk.txt"))
def test_simulated_teenastro_answers_as_its_sources_and_its_emulator_say(state: str, sent: str, reply: str) -> None:
    assert fits(controller("teenastro", state)[0].feed(raw(sent)), reply)


@each("model", ["onstep", "teenastro"])
def test_onstep_and_teenastro_are_never_sent_dangerous_commands(model: str) -> None:
    """Nothing of this is in its table, so that no row and no program of the gateway can send it."""
    commands = load("lx200").in_dialect_of(model).commands
    assert not {"AP", "AL", "AA", "hF", "hS", "U", "h?", "I", "hN", "Sw", "Rg"} & commands.keys()
    frames = [command.request.prefix for command in commands.values()]
    assert not [frame for frame in frames if frame.startswith((b";", b":A", b":hF", b":hS", b":U"))]


@each("model", ["onstep", "teenastro"])
def test_every_onstep_and_teenastro_command_has_a_form_in_its_sources(model: str) -> None:
    """The beginnings of the forms that were typed by hand."""
    forms = re.compile("|".join(f"(?:{row[0]})" for row in rows(f"{model}_sent.txt")).encode("latin-1"))
    arguments: dict[str, Any] = {
        "Sr": b"01:02:03", "Sd": b"+01*02:03", "Sa": b"+01*02:03", "Sz": b"001*02:03", "St": b"+01*02",
        "Sg": b"+001*02", "SL": b"01:02:03", "SC": b"01/02/26", "Mg": b"n0100", "ST": b"060.1", "SXT2": b"1768514400",
        "SG": b"+01:00" if model == "onstep" else b"+01.0",
    }  # fmt: skip
    for name, command in load("lx200").in_dialect_of(model).commands.items():
        frame = command.request.prefix.removesuffix(b"#") + arguments.get(name, b"") + (b"#" if name != "ACK" else b"")
        assert forms.fullmatch(frame), frame


def test_simulated_onstep_ignores_blanks_inside_a_command() -> None:
    sim, _ = controller("onstep")
    assert sim.feed(b": G R #\r\n")[-1:] == b"#"  # blanks and line ends are dropped


def test_simulated_onstep_ends_an_arrow_after_ten_seconds() -> None:
    sim, clock = controller("onstep")
    sim.feed(b":R9#:Mn#")
    clock.now += 9.0
    assert b"g" in sim.feed(b":GU#")
    sim.feed(b":Mn#")  # the same again changes nothing
    clock.now += 2.0
    assert b"g" not in sim.feed(b":GU#")


@pytest.mark.parametrize("separate", [True, False])
def test_simulated_onstep_without_a_pulse_rate_pulses_at_the_arrow_rate(separate: bool) -> None:
    sim, clock = controller("onstep")
    sim.has_pulse_rate = separate
    sim.feed(b":MS#")
    clock.now += 200.0
    before = sim.true_position()[1]
    sim.feed(b":RS#:Mgn1000#")
    clock.now += 10.0
    assert (abs(sim.true_position()[1] - before) > 1.0) is not separate
