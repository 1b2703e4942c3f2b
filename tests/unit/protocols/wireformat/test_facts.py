"""Facts about commands, typed from the manuals and from what mounts do; a row that lacks one it needs is named.

Commands that are added may share these facts, so the typed ones are a part of all.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from gateway.core.errors import MappingError
from gateway.protocols.base.driver import Send
from gateway.protocols.lx200.reply_rules import Lx200ReplyRules
from gateway.protocols.nexstar.reply_rules import NexStarReplyRules
from gateway.protocols.registry import PROTOCOLS
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load, mappings_folder
from tests.support.scripts import script

LX200, NEXSTAR = load("lx200"), load("nexstar")


def having(protocol: CommandSet, fact: str) -> dict[str, object]:
    """Command -> the fact, where it is said."""
    values = {name: getattr(command, fact) for name, command in protocol.commands.items()}
    return {name: value for name, value in values.items() if value not in (None, False, [], {})}


def answering(protocol: CommandSet, word: str) -> set[str]:
    return {name for name, command in protocol.commands.items() if command.answer_kind == word}


def test_command_tables_say_how_each_answer_changes_over_time() -> None:
    assert answering(LX200, "position") >= {"GR", "GD", "GZ", "GA"}
    assert answering(LX200, "clock") >= {"GL", "Ga", "GS"}
    assert answering(LX200, "stream") >= {"gps"}
    assert answering(NEXSTAR, "position") >= {*"EeZz", "gps_latitude", "gps_longitude", "axis_position"}
    assert answering(NEXSTAR, "clock") >= {"h", "i", "l", "gps_time", "rtc_time"}
    assert answering(NEXSTAR, "stream") >= {"K"}
    for protocol in (LX200, NEXSTAR):
        questions = {name for name, command in protocol.commands.items() if command.is_query}
        assert questions == {name for name in protocol.commands if protocol.commands[name].answer_kind}


def test_command_tables_say_which_answers_need_no_verification() -> None:
    lx200, nexstar = Lx200ReplyRules().expected_reply, NexStarReplyRules().expected_reply
    kinds = [
        one.answer_kind
        for one in (lx200(Send("GW")), lx200(Send("h?")), nexstar(Send("p")), lx200(Send("LM", include_raw=True)))
    ]
    assert kinds == ["state"] * 4
    believed = (lx200(Send("Gr", once=True)), lx200(Send("gps", include_raw=True)), lx200(Send("MS")))
    assert [one.answer_kind for one in (*believed, nexstar(Send("K")), nexstar(Send("M")))] == [None] * 5


def test_command_tables_say_which_commands_end_motions() -> None:
    axes = ("Qe", "Qn", "Qs", "Qw")
    urgent = {"Q": "stop", "I": "restart", **dict.fromkeys(axes, "axis"), "FQ": "part"}
    assert having(LX200, "urgent").items() >= urgent.items()
    along = {axis: ["Me", "Mw"] if axis in ("Qe", "Qw") else ["Mn", "Ms"] for axis in axes}
    assert having(LX200, "discarded_commands").items() >= along.items()
    motors = [
        f"{what}_{axis}_{sense}" for what in ("slew", "rate") for axis in ("azm", "alt") for sense in ("pos", "neg")
    ]
    assert having(NEXSTAR, "urgent") == dict.fromkeys(("M", *motors), "part")
    assert having(NEXSTAR, "urgent_values") == {key: {"rate": 0} for key in motors}
    marks = {name: NEXSTAR.commands[name].urgent_mark for name in ("M", "slew_azm_pos", "rate_alt_neg")}
    assert marks == {"M": b"M", "slew_azm_pos": b"P\x02\x10\x24\0", "rate_alt_neg": b"P\x03\x11\x07\0\0"}
    assert LX200.commands["Q"].urgent_mark == b":Q"


def test_driver_stop_includes_every_command_that_ends_motion() -> None:
    assert [way.ends for way in LX200.driver_rows["AbortMotion"]] == [["Q"]]
    assert [way.ends for way in NEXSTAR.driver_rows["AbortMotion"]] == [["M", "slew_azm_pos", "slew_alt_pos", "pulse"]]


def mistakes(folder: Path) -> list[str]:
    """What is wrong with the tables of a folder."""
    try:
        found: list[str] = list(script("docs/tools/mistakes.py").mistakes(CommandSet("lx200", folder)))
    except MappingError as error:
        return [str(error)]
    return found


def test_driver_table_whose_abort_names_no_ending_command_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "commands.toml").write_text('[Q]\nrequest = ":Q#"\nhelp = "stop"\n', "utf-8")
    (tmp_path / "driver.toml").write_text('[[AbortMotion]]\ncall = "pointing.abort"\nuses = ["Q"]\n', "utf-8")
    assert any("it needs ends" in mistake for mistake in mistakes(tmp_path))


def test_command_tables_mark_long_commands_and_those_allowed_while_busy() -> None:
    assert having(LX200, "long").items() >= {"SC": 14.0, "gT": 600.0}.items()
    assert having(LX200, "allowed_while_homing").keys() >= {"hS", "hF", "Q", "h?"}
    asleep = {name for name, command in LX200.commands.items() if command.allowed_while_asleep is False}
    assert asleep >= {"MS", "MA", "Mn", "Ms", "Me", "Mw", "Mg", "hP", "hS", "hF"}
    assert having(NEXSTAR, "allowed_while_asleep").keys() == set("KVxy")
    rates = {"RG", "RC", "RM", "RS", "Sw", "RA", "RE", "Rg"}
    assert having(LX200, "by_hand").keys() >= rates | {"Mn", "Ms", "Me", "Mw", "Mg"}
    assert having(LX200, "may_be_silent").keys() >= {"GZ", "GA", "CM"}


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ('reply = "{ra:HH:MM:SS}#"', "it needs answer"),
        ('reply = "{ra:HH:MM:SS}#"\nanswer = "place"', "'place' .*answer"),
        ('reply = "1"\nanswer = "state"', "answer is for a command that asks"),
        ('urgent = "now"', "'now' .*urgent"),
        ('takes_back = ["Me"]', "for a command that is urgent"),
        ('urgent = "axis"\ntakes_back = ["Mx"]', r"there is no \[Mx\]"),
        ('urgent = "part"\nurgent_at = { rate = 0 }', "the request has no field rate"),
    ],
)
def test_mistake_in_a_row_of_commands_toml_is_reported(tmp_path: Path, row: str, says: str) -> None:
    (tmp_path / "commands.toml").write_text(f'[ZZ]\nrequest = ":ZZ#"\nhelp = "trial"\n{row}\n', "utf-8")
    assert any("[ZZ]" in mistake and re.search(says, mistake) for mistake in mistakes(tmp_path))


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ('ZZ = { say = {}, outcome = "kept", given = { axis = 1 } }', "given is only for a row with ask"),
        ('Q = { say = {}, outcome = "kept" }', "needs ask, which names the operation"),
    ],
)
def test_impossible_row_in_surface_toml_is_reported(tmp_path: Path, row: str, says: str) -> None:
    (tmp_path / "commands.toml").write_text(
        '[ZZ]\nrequest = ":ZZ#"\nhelp = "trial"\n[Q]\nrequest = ":Q#"\nhelp = "stop"\nurgent = "stop"\n', "utf-8"
    )
    (tmp_path / "surface.toml").write_text(row, "utf-8")
    assert any(re.search(says, mistake) for mistake in mistakes(tmp_path))


def test_adding_a_command_changes_only_one_line_of_each_printed_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two files by hand: what it looks like, and what is done with it."""
    command_tables = script("docs/tools/tables.py")
    before = command_tables.TARGET.read_text("utf-8")  # test_tables proves that it is up to date
    shutil.copytree(mappings_folder() / "lx200", tmp_path / "lx200")
    with (tmp_path / "lx200" / "commands.toml").open("a") as file:
        file.write('\n[ZZ]\nrequest = ":ZZ#"\nreply = "{ra:HH:MM:SS}#"\nhelp = "trial"\nanswer = "position"\n')
    with (tmp_path / "lx200" / "surface.toml").open("a") as file:
        file.write('\nZZ = { ask = "Position", outcome = "translated" }\n')
    sets = {name: load(name) for name in PROTOCOLS} | {"lx200": CommandSet("lx200", tmp_path / "lx200")}
    monkeypatch.setattr(command_tables, "load", sets.__getitem__)
    old, new = before.splitlines(), command_tables.text().splitlines()
    assert isinstance(sets["lx200"].commands["ZZ"], Command)
    assert [line for line in new if line not in old] == [
        "| `:ZZ#` | trial | translated | `e`, `E` |  |",
        "| `:ZZ#` | trial | translated | `devicestate`, `rightascension`, `declination` |  |",
    ]
    assert len(new) == len(old) + 2
