"""What explain says is for the owner of a mount: no constructors, no bare degrees of right ascension."""

from __future__ import annotations

import re
from typing import Any, get_args, get_type_hints

import pytest

from gateway.cli import main
from gateway.core import operations as op
from gateway.diagnostics.rehearsal.explain import explain
from gateway.diagnostics.rehearsal.meaning import meaning
from gateway.protocols.wireformat.rows import Outcome
from tests.support.each import each

SAMPLES: dict[type, Any] = {
    float: 12.5, int: 1, str: "GVP", bool: True, op.Direction: op.Direction.NORTH, op.Tracking: op.Tracking.EQ_NORTH,
    op.Rate: op.Rate("max", 9, 2.0), tuple: (), type(None): None,
}  # fmt: skip
EVERY = [kind for name in dir(op) if (kind := op.operation_class(name)) is not None]


def made(kind: type[op.Operation]) -> op.Operation:
    """An operation in which everything is set."""
    hints = get_type_hints(kind)
    values = {}
    for name in kind.__struct_fields__:
        first = next(iter(get_args(hints[name])), hints[name])
        values[name] = SAMPLES.get(hints[name], SAMPLES.get(first, ()))
    return kind(**values)


@each("kind", EVERY)
def test_explain_has_words_for_every_operation(kind: type[op.Operation]) -> None:
    words = meaning(made(kind))
    assert kind.__name__ not in words.split() and not re.search(r"[=<>]|None|\w\(", words), words
    assert len(words.split()) > 1


@each(
    ("operation", "words"),
    [
        (op.Goto(83.63333, 22.01444), "go to RA 05:34:32, Dec +22°00'52\", and track there"),
        (
            op.Goto(83.63333, 22.01444, lowest=10.0, track=False),
            "go to RA 05:34:32, Dec +22°00'52\", no lower than 10°",
        ),
        (op.Sync(0.0, -5.5), "the mount points at RA 00:00:00, Dec -05°30'00\" now"),
        (op.Move(op.Direction.WEST, op.Rate("find")), "move west at finding speed, until it is stopped"),
        (
            op.Move(op.Direction.EAST, op.Rate("max", degrees=2.0)),
            "move east at full speed, no faster than 2° a second, until it is stopped",
        ),
        (
            op.MoveAxis(2, -1, op.Rate(key=9)),
            "turn the second axis (declination or altitude) backwards with speed 9 of the hand control, until it is "
            "stopped",
        ),
        (op.SetTracking(False), "tracking off"),
        (op.SetTracking(True), "tracking on"),
        (op.SetTracking(True, op.Tracking.EQ_SOUTH), "tracking on equatorially, in the south"),
        (op.TrackRate("lunar"), "track at the lunar rate"),
        (op.TrackRate(factor=1.5), "track at 1.5 of the sidereal rate"),
        (op.SetSite(latitude=-33.5), "the mount stands at latitude 33°30'00\" S"),
        (op.SetSite(), "the mount's site"),
        (op.SetSite(others=()), "the site is the one of the hand control"),
        (op.SetClock(0.0, -7.5, 0), "it is 1970-01-01 00:00:00 UTC, UTC-7.5 h here, no daylight saving"),
        (op.Focus(0), "stop the focuser"),
        (op.Focus(-1, 4), "move the focuser out, speed 4"),
        (op.PeriodicError(), "periodic error correction of both axes the other way round"),
        (op.MoonPlace(), "where is the middle of the Moon now?"),
        (op.MoonPlace(17.0, 59.0), "where is 17°00'00\" N, 59°00'00\" E on the Moon now?"),
    ],
)
def test_explain_says_what_an_operation_does(operation: op.Operation, words: str) -> None:
    assert meaning(operation) == words


def test_explain_describes_a_goto_in_an_owners_terms() -> None:
    told = explain("lx200", "6se", ":MS#").text.splitlines()
    assert told[0] == ":MS#  slew to the target"
    assert told[1].startswith("outcome on a 6-8se/4.21 mount: trans")
    assert any("go to RA 05:34:32, Dec +22°00'52\", and track" in line for line in told)
    assert any("to the mount: r3B78FC00,0FA79B00" in line and "RA 05:34:32" in line for line in told)
    assert told[-1] == "reply: 0"


def test_explain_shows_values_and_replies_in_sexagesimal_form() -> None:
    told = explain("lx200", "etx", ":Sr05:34:32#").text.splitlines()
    assert told[1] == "  RA 05:34:32" and told[2].startswith("answered by the gateway")
    assert explain("lx200", "nexstar", ":GD#").text.splitlines()[-1] == "reply: +00*00:00#  (Dec +00°00'00\")"


def test_explain_shows_the_requests_of_a_goto_on_an_alpaca_telescope() -> None:
    told = explain("lx200", "alpaca", ":MS#").text.splitlines()
    assert told[0].startswith(":MS#") and told[1].startswith("outcome on a german mount: translated")
    *_, asked, ordered, reply = told
    assert "get devicestate\\x0a" in asked
    assert "slewtocoordinatesasync RightAscension=5" in ordered
    assert ordered.endswith("RA 05:34:32, Dec +22°00'52\"") and reply == "reply: 0"


def test_explain_has_text_for_any_command_outcome() -> None:
    from gateway.diagnostics.command_outcomes import OUTCOME_MEANINGS

    assert tuple(OUTCOME_MEANINGS) == get_args(Outcome)
    assert "mount: refused" in explain("lx200gps", "cge/3.02", ":gT#").text


def test_explain_describes_the_reply_that_a_program_really_gets() -> None:
    """Of the model that is presented because it fits; where a refusal has no reply, that is said."""
    gps = explain("nexstar", "lx200gps", "P\\x01\\xb0\\x37\\x00\\x00\\x00\\x01").text
    assert "on an lx200gps mount: translated (" in gps and gps.endswith("reply: \\x01#  (linked)")
    classic = explain("nexstar", "lx200:lx200", "x").text
    assert "refused (the reply is # all the same" in classic
    assert "refused (this command has no reply" in explain("lx200", "cge/1.2", ":T-#").text


def test_explain_says_when_values_make_a_command_refused() -> None:
    otherwise = "  with other values, or in another state: translated\n"
    midnight = explain("nexstar", "lx200", "H\\x18\\x00\\x00\\x01\\x01\\x1a\\x00\\x00").text  # 24 o'clock
    assert "mount: refused (" in midnight and otherwise in midnight
    assert otherwise not in explain("nexstar", "lx200", "H\\x17\\x00\\x00\\x01\\x01\\x1a\\x00\\x00").text
    assert otherwise not in explain("lx200", "6se", ":MS#").text


@each(
    ("mount", "command", "lines"),
    [
        ("lx200:lx200", "T\\x02", ["outcome on an lx200 mount: nothing to do (the mount is as the command wants it)"]),
        ("lx200:lx200", "T\\x00", ["outcome on an lx200 mount: refused (the reply is # all the same, "]),
        (
            "lx200:lx200",
            "P\\x01\\xb0\\x37\\x00\\x00\\x00\\x01",
            ["outcome on an lx200 mount: refused (the reply says so)"],
        ),
        ("avx", ":F+#", ["outcome on an avx/5.31 mount: translated (", "  without a focuser: refused"]),
        ("slt", ":MA#", ["outcome on a slt/4.21 mount: translated (", "  before the alignment: refused"]),
        ("cpc", ":hP#", ["outcome on a cpc/4.21 mount: translated (", "  before the alignment: refused"]),
    ],
)
def test_explain_names_the_outcome_of_a_command_on_a_mount(mount: str, command: str, lines: list[str]) -> None:
    text = explain("lx200" if command.startswith(":") else "nexstar", mount, command).text
    for line in lines:
        assert f"\n{line}" in text


@each(
    ("command", "why", "reply"),
    [
        (":Foo#", "'oo' is not a number", "none"),
        (":Sr25:00:00#", "'25:00:00' is not from 0 to 360", "0  (Invalid value.)"),
        (":Sh85.5#", "'85.5' has decimals, and this form has none", "0  (Invalid value.)"),
    ],
)
def test_explain_refuses_an_invalid_value_in_plain_words(
    command: str, why: str, reply: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", "lx200", "cpc", command]) == 1
    told = capsys.readouterr().out
    assert f"  not valid: {why}\noutcome: refused (" in told and told.endswith(f"reply: {reply}\n")
    assert "b'" not in told


def test_explain_reports_a_command_that_the_hand_control_lacks() -> None:
    assert main(["explain", "nexstar:nexstar-gps/1.2", "lx200", "e"]) == 1
    assert main(["explain", "lx200", "cpc", ":GR#"]) == 0


@pytest.mark.parametrize("command", [":MS#", ":MA#", ":hP#"])
def test_explain_does_not_call_a_sped_up_mount_wrongly_placed(command: str) -> None:
    assert "axis stands" not in explain("lx200", "nexstar", command).text
