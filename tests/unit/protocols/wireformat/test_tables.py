"""The mappings are sound, and a broken row is named with its file and its reason."""

from __future__ import annotations

import asyncio
import re
import shutil
from collections import Counter
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest
from msgspec.structs import replace

import gateway
from gateway.core.errors import MappingError, UserError
from gateway.diagnostics import command_outcomes
from gateway.diagnostics.rehearsal.explain import explain
from gateway.diagnostics.rehearsal.samples import sample_value
from gateway.diagnostics.virtual_time import run
from gateway.mount.policy import Limits
from gateway.protocols.base.spec import DriverSettings, ProtocolSpec, SurfaceSettings
from gateway.protocols.registry import PROTOCOLS as SPECS
from gateway.protocols.wireformat.command_set import CommandSet, load, mappings_folder
from tests.support.each import each
from tests.support.in_process_gateway import Bridge
from tests.support.scripts import script

PROTOCOLS = [load("lx200"), load("nexstar")]
TABLES = script("docs/tools/tables.py")


@each("protocol", PROTOCOLS)
def test_every_request_is_recognised_as_its_own_command(protocol: CommandSet) -> None:
    for command in protocol.commands.values():
        for picture in command.requests:
            frame = picture.encode({name: sample_value(command, name, field) for name, field in picture.fields.items()})
            found = protocol.find(frame)
            assert found is not None, command
            # A frame may be written by a more general row, too; its own length and literal must win.
            assert found[0] is command or len(found[1].prefix) >= len(picture.prefix), (command, frame, found)


@each("protocol", PROTOCOLS)
def test_no_reply_of_a_command_is_a_prefix_of_another(protocol: CommandSet) -> None:
    for command in protocol.commands.values():
        wires = {  # several faults may have one form
            (
                repr(reply.wire),
                picture.encode({name: sample_value(command, name, field) for name, field in picture.fields.items()}),
            )
            for reply, picture in command.replies
            if reply.when is None
        }
        for (_, one), (_, other) in combinations(sorted(wires), 2):
            assert not one.startswith(other), command
            assert not other.startswith(one), command


def _called_and_there(spec: ProtocolSpec) -> Iterator[tuple[set[str], set[str]]]:
    """What the rows of a surface and of a driver call, and what there is to be called."""
    if spec.make_surface is not None:
        made = spec.make_surface(SurfaceSettings(None, None, None, None, Limits()))
        yield {row.call for row in spec.commands.surface_rows.values() if row.call}, set(made.surface.handlers)
    if spec.make_driver is not None:
        driver = spec.make_driver(DriverSettings(), float).driver
        sets = (spec.commands, *map(spec.commands.in_dialect_of, spec.commands.dialect_by_model))
        ways = [way for one in sets for ways in one.driver_rows.values() for way in ways]
        yield {way.call for way in ways if way.call}, set(driver.handlers)


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_no_function_available_to_command_tables_is_unused(spec: ProtocolSpec) -> None:
    protocols = Path(gateway.__file__).parent / "protocols"
    files = [path for folder in ("base", spec.name) for path in (protocols / folder).rglob("*.py")]
    words = Counter(word for path in files for word in re.findall(r"\w+", path.read_text("utf-8")))
    for called, there in _called_and_there(spec):
        assert not {name for name in there - called if words[name.rpartition(".")[2]] < 2}


#: What somebody may type into a table: file, the row in place of all others or behind them, and what is said of it.
MISTAKES = [
    ("driver.toml", '[[Goto]]\ncall = "pointing.gotoo"', r"\[Goto\]: call: .*'pointing.gotoo'"),
    ("driver.toml", '[[Goto]]\ncall = "goto"', r"\[Goto\]: call: .*'goto'"),
    ("driver.toml", '[[Goto]]\ncall = "pointing.goto"\npart = "gpps"', r"\[Goto\]: part: .*gpps"),
    ("surface.toml", 'GD = { call = "accessories.linked_state" }', r"\[GD\]: .*linked_state"),
    ("surface.toml", 'GZ = { call = "_clear" }', r"\[GZ\]: .*_clear"),
    ("surface.toml", 'GR = { call = "clock.round_to_half_hour" }', r"\[GR\]: call: .*round_to_half_hour takes offset"),
    ("surface.toml", 'GVP = { tell = ["produkt"] }', r"\[GVP\]: its reply has product, not produkt"),
    ("surface.toml", "P = { say = { precison = 1 } }", r"\[P\]: its reply has precision, not precison"),
    ("surface.toml", 'P = { say = { precision = "LOW" } }', r"\[P\]: say: .*its reply is"),
    ("surface.toml", 'GT = { ask = "Position", given = { axsis = 1 } }', r"\[GT\]: .*axsis"),
    ("surface.toml", 'GR = { ask = "Positoin" }', r"\[GR\]: no operation is called 'Positoin'"),
    (
        "surface.toml",
        'GR = { call = "motion.tell_menu_line", asks = ["Positoin"] }',
        r"\[GR\]: no operation is called 'Positoin'",
    ),
    ("surface.toml", 'GR = { ask = "Position", tell = ["ra"] }', r"\[GR\]: one verb"),
    ("surface.toml", "QQQ = { say = {} }", r"\[QQQ\]: .*no such command"),
    ("surface.toml", 'GR = { aks = "Position" }', r"\[GR\]: .*aks"),
    (
        "surface.toml",
        'GR = { call = "motion.tell_menu_line", outcome = "translated" }',
        r"\[GR\]: what is translated needs ask",
    ),
    ("surface.toml", '"$QA+" = { call = "accessories.silence", outcome = "refused" }', r"\[\$QA\+\]: .*needs why"),
    ("surface.toml", 'Aa = { call = "motion.check_alignment", outcome = "keept" }', r"\[Aa\]: .*'keept'"),
    ("surface.toml", "Aa = { say = {}, outcome = { fork = 'kept' } }", r"\[Aa\]: the last kind of mount"),
    (
        "surface.toml",
        "ED = { call = 'accessories.silence', outcome = { as-lx2000 = 'kept', else = 'kept' } }",
        r"\[ED\]: .*'as-lx2000'",
    ),
    ("surface.toml", "GR = {", "surface.toml"),
    ("commands.toml", '[GR]\nrequest = ":GR{x:nonsense}#"\nhelp = "x"', r"\[GR\]: .*nonsense"),
    ("commands.toml", '[GR]\nrequest = ":GR{x}#"\nhelp = "x"', r"\[GR\]: .*name:form"),
    ("commands.toml", '[GR]\nhelp = "x"', r"\[GR\]: it needs a request"),
    ("commands.toml", '[GR]\nrequest = ":GR#"', r"\[GR\]: .*`help`"),
    ("commands.toml", '[GR]\nrequest = ":GR#"\nhelp = "x"\nmodels = ["lx2000"]', r"\[GR\]: models: there is no lx2000"),
    ("commands.toml", '[GR]\nrequest = ":GR#"\nhelp = "x"\nreply = "{x:n}#"\nanswer = "stat"', r"\[GR\]: .*answer"),
    ("models.toml", '+[mine]\nlike = "autostarr"', r"\[mine\]: like: there is no model 'autostarr'"),
    ("models.toml", '+[mine]\ndialect = "onstepp"', r"\[mine\]: dialect: there is no onstepp.toml"),
    ("models.toml", '+[mine]\nmount = "germann"', r"\[mine\]: .*germann"),
    ("models.toml", '+[mine]\nproduckt = "LX"', r"\[mine\]: .*produckt"),
    ("models.toml", '+[mine]\nrates = "see"', r"\[mine\]: rates: rates.toml has no \[see\]"),
    ("surface.toml", 'SL = { ask = "SetTracking" }', r"\[SL\]: ask: SetTracking has no field 'time'"),
    ("onstep.toml", "has = ['Zz']", r"\[has\]: there is no Zz"),
]


@pytest.mark.parametrize(("file", "row", "says"), MISTAKES)
def test_mistake_in_a_table_is_reported_with_file_and_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, row: str, says: str
) -> None:
    """By the check of the printed tables: it makes every part of every protocol."""
    folder = tmp_path / "lx200"
    shutil.copytree(mappings_folder() / "lx200", folder)
    if file == "surface.toml" and "outcome" not in row:
        row = row.replace(" }", ', outcome = "kept" }') if row.count("}") == 1 else row[:-2] + ', outcome = "kept" }'
    before = (folder / file).read_text("utf-8") if row.startswith("+") else ""
    (folder / file).write_text(before + row.removeprefix("+"), "utf-8")

    def check() -> str:
        try:
            changed = CommandSet("lx200", folder)
            monkeypatch.setattr(
                "gateway.protocols.base.spec.load", lambda name: changed if name == "lx200" else load(name)
            )
            return "\n".join(TABLES.problems())
        except MappingError as error:
            return str(error)

    assert [line for line in check().splitlines() if re.search(says, line) and f"lx200/{file}" in line]


def test_unknown_mount_kind_in_a_table_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    row = replace(load("lx200").surface_rows["Mg"], outcome={"germann": "refused", "else": "translated"})
    monkeypatch.setitem(load("lx200").surface_rows, "Mg", row)
    assert "mappings/lx200/surface.toml: [Mg]: outcome: no mount is 'germann'" in TABLES.problems()


def test_printed_tables_are_up_to_date() -> None:
    assert list(TABLES.problems()) == []


def test_outdated_printed_tables_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TABLES, "ROOT", tmp_path)
    for page in ("TARGET", "KEYS", "PROVE"):
        monkeypatch.setattr(TABLES, page, old := tmp_path / page)
        old.write_text(TABLES.BEGIN + "old" + TABLES.END, "utf-8")
    assert [problem.partition(" is old")[0] for problem in TABLES.problems()] == ["TARGET", "KEYS", "PROVE"]


def test_missing_row_in_surface_toml_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = {name: row for name, row in load("lx200").surface_rows.items() if name != "LM"}
    monkeypatch.setattr(load("lx200"), "surface_rows", kept)
    assert "mappings/lx200/surface.toml: [LM]: it has no outcome on a nexstar mount" in TABLES.problems()


def test_explain_command_uses_the_named_model() -> None:
    told = explain("lx200:lx200gps", "nexstar:cpc/4.21", ":gT#").text
    assert "outcome on a cpc/4.21 mount: kept (" in told and "\n  before the alignment: translated\n" in told
    assert "outcome on a cge/3.02 mount: refused" in explain("lx200:lx200gps", "nexstar:cge/3.02", ":gT#").text
    assert "reply: 3.34#" in explain("lx200:lx200", "nexstar", ":GVN#").text
    assert "reply: \\x03\\x02#" in explain("nexstar:cge/3.02", "lx200", "V").text
    assert "version 1.2 does not know it" in explain("nexstar:nexstar-gps/1.2", "lx200", "e").text
    assert "the gateway keeps it as an offset" in explain("lx200", "nexstar:i-series/1.6", ":CM#").text
    with pytest.raises(UserError, match="no model 'cgx9'"):
        explain("lx200", "nexstar:cgx9", ":CM#")


def test_command_without_outcome_on_one_old_version_fails_the_table_check(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = {name: ways[:1] if name == "Sync" else ways for name, ways in load("nexstar").driver_rows.items()}
    monkeypatch.setattr(load("nexstar"), "driver_rows", kept)
    assert TABLES.missing("lx200", "nexstar") == ["CL", "CM"]


@each(
    ("said", "outcome"),
    [
        (b":AL#", "refused"),
        (b":AP#", "refused"),
        (b":Sr05:00:00#:Sd+45*00:00#:CM#", "kept"),
        (b":Ga#", "kept"),
        (b":GC#", "kept"),
        (b":GG#", "kept"),
        (b":Gg#", "kept"),
        (b":GL#", "kept"),
        (b":Gt#", "kept"),
        (b":hN#", "refused"),
        (b":hW#", "refused"),
        (b":I#", "translated"),
        (b":Mgn0500#", "refused"),
        (b":RS#:Mn#", "translated"),
    ],
)
@each(("model", "version"), [("nexstar-gps", "1.2"), ("gt", "101.0")])
def test_command_outcomes_printed_for_the_oldest_hand_controls_are_true(
    model: str, version: str, said: bytes, outcome: str
) -> None:
    """What is kept there sends nothing but questions; what is translated moves the mount."""

    async def program() -> list[bytes]:
        config = {"site": (45.0, 10.0), "mode": "alt-az"}
        async with Bridge(model, version, config=config) as bridge:
            before = len(bridge.sent_requests())
            await bridge.client().ask(said, 1.0)
            await asyncio.sleep(1.0)
            return [sent for sent in bridge.sent_requests()[before:] if sent[:1] not in b"EZJL"]

    name = load("lx200").find(b":" + said.rpartition(b":")[2])
    assert name is not None
    mount = load("nexstar")
    row = load("lx200").surface_rows[name[0].name]
    kind = command_outcomes.MountKind(model, SPECS["nexstar"].command_set_version(version))
    assert command_outcomes.outcome(row, mount, kind) == outcome
    assert bool(run(program())) == (outcome == "translated")
