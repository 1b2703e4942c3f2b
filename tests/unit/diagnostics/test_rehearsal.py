"""Rehearsals: every row can be explained, and what the tables say of a row is compared with what the wire carries."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
from msgspec.structs import replace

from gateway.app.config import Endpoint, parse_device
from gateway.core.errors import UserError
from gateway.diagnostics.command_outcomes import Kind
from gateway.diagnostics.rehearsal import wire
from gateway.diagnostics.rehearsal.explain import explain
from gateway.diagnostics.rehearsal.judge import Case, differences
from gateway.diagnostics.rehearsal.play import Event, Play
from gateway.diagnostics.rehearsal.samples import example
from gateway.protocols.base.surface import Surface
from gateway.protocols.registry import pairs
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Implementation, SurfaceRow
from tests.support.each import each
from tests.support.sampling import as_a_rule


@pytest.mark.parametrize(("client", "mount"), pairs())
def test_every_row_is_explained(client: str, mount: str) -> None:
    asked = [item for item in load(client).commands.items() if item[1].asked]
    for name, command in asked[:: as_a_rule(9, whole=1)]:
        told = explain(client, mount, "".join(f"\\x{byte:02x}" for byte in example(command))).text
        assert command.help in told, name
        assert ": missing" not in told, name
        assert "\nreply: " in told, name


#: The mounts that have the least, the oddest and the most, behind different models.
SOME = [
    ("lx200:autostar", "nexstar:nexstar-gps/1.2"), ("lx200:lx200", "nexstar:cge/3.02"),
    ("lx200:lx200gps", "nexstar:cpc/4.21"), ("lx200:lx200-16", "nexstar:avx/5.31"),
    ("nexstar:nexstar-gps/1.2", "lx200:autostar"), ("nexstar:cge/3.02", "lx200:lx200"),
    ("nexstar:cge/2.3", "lx200:lx200gps"), ("lx200:lx200gps", "nexstar:nexstar-gps/2.2"),
    ("nexstar:cpc/4.21", "lx200:lx200gps"), ("nexstar:gt/104.0", "lx200:lx200-16"),
    ("stellarium", "nexstar:nexstar-gps/1.2"), ("stellarium", "nexstar:avx/5.31"), ("stellarium", "lx200:lx200"),
]  # fmt: skip


@pytest.mark.sampled(every=6)
@pytest.mark.parametrize(("face", "mount"), SOME)
def test_the_tables_say_what_the_wire_carries(face: str, mount: str) -> None:
    plays, found = wire.rehearse(wire.Pair(parse_device(face), parse_device(mount)))
    assert plays >= sum(command.asked for command in load(face.partition(":")[0]).commands.values())
    assert list(wire.report(found)) == []


CPC = wire.Pair(Endpoint("lx200", "-", "lx200gps"), Endpoint("nexstar", "-", "cpc", "4.21"))
OVER_MEADE = wire.Pair(Endpoint("nexstar", "-", "cge", "4.21"), Endpoint("lx200", "-", "lx200gps"))


@pytest.mark.parametrize(
    ("pair", "name", "row", "says"),
    [
        (CPC, "GD", {"outcome": "kept", "call": "accessories.silence"}, "kept, and yet there is no reply"),
        (CPC, "GVP", {"outcome": "translated"}, "the mount has never been asked"),
        (CPC, "GVP", {"outcome": "silent"}, "silent, and yet 'LX2001#' is said"),
        (CPC, "AL", {"outcome": "kept"}, "kept, and yet T goes to the mount"),
        (CPC, "B+", {"outcome": "kept"}, "kept, and nothing is kept"),
        (CPC, "St", {"outcome": "translated"}, "translated, and nothing that changes the mount is sent"),
        (CPC, "SS", {"outcome": "kept"}, "kept, and yet the reply is no: '0'"),
        (CPC, "SB", {"outcome": "refused"}, "refused, and the reply '1' is no no"),
        (CPC, "$QA+", {"why": None}, "no remark on it, and the log says"),
        (CPC, "AL", {"asks": ["Sync"]}, "T goes to the mount, and is not listed"),
        (OVER_MEADE, "pec_record", {"outcome": "kept"}, "kept, and yet the reply is no"),
    ],
)
def test_a_row_that_says_something_else_is_found(
    monkeypatch: pytest.MonkeyPatch, pair: wire.Pair, name: str, row: dict[str, object], says: str
) -> None:
    rows: dict[str, SurfaceRow] = load(pair.face.protocol).surface
    monkeypatch.setitem(rows, name, replace(rows[name], **row))
    _, found = wire.rehearse(pair, frozenset([name]))
    assert any(says in difference.words for difference in found), found


def test_a_way_that_is_not_taken_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(load("nexstar").driver, "SetSite", [Implementation(call="place.set_site", uses=["W"])])
    _, found = wire.rehearse(CPC, frozenset(["Sg"]))
    assert [difference.words for difference in found] == ["translated, and nothing that changes the mount is sent"]


def test_a_mount_that_says_no_while_the_program_hears_yes_is_found() -> None:
    nexstar, protocol = load("nexstar"), load("lx200")
    surface = Surface(protocol, {})
    request = bytes((80, 2, 17, 36, 9, 0, 0, 0))  # P: move the altitude motor by key 9, no reply byte asked for

    def words(answer: bytes, *notes: Event) -> list[str]:
        events = (Event("act", "", request), Event("answer", "", answer), *notes, Event("reply", ""))
        row = protocol.commands["Mn"], protocol.surface["Mn"]
        case = Case(*row, frozenset(), nexstar, Kind("cpc", (4, 21), aligned=True), False)
        return list(differences(case, Play(b":Mn#", events, b"", (request,), False, True), surface, frozenset()))

    assert words(b"#") == []
    assert words(b"\x00#") == ["the mount says no, and nobody is told"]  # one byte too many: no such device
    assert words(b"\x00#", Event("note", "Move: No such device on the mount.")) == []


def test_a_new_model_is_played_without_being_listed() -> None:
    """A new row is, too: no fewer commands are played than there are (``test_the_tables_say_...``)."""
    models = {(str(pair.face), str(pair.mount)) for pair in wire.pairs()}
    assert len(models) == len(list(wire.pairs()))
    assert {pair.mount.model for pair in wire.pairs()} == load("lx200").models.keys() | load("nexstar").models.keys()


def test_the_check_counts_what_it_has_played(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wire, "ProcessPoolExecutor", lambda *_: ThreadPoolExecutor(1))  # a process loads for a second
    assert wire.check([wire.Pair(Endpoint("stellarium", "-"), Endpoint("lx200", "-", "lx200"))]) == 0
    assert capsys.readouterr().out == "1 pair of models, 1 commands played, 0 differences\n"  # its goto


def test_a_difference_is_told_once_with_the_pairs_that_show_it() -> None:
    found = [wire.Difference("lx200", "GR", "kept, and yet", f"autostar on cpc/{text}") for text in ("4.10", "4.21")]
    assert list(wire.report(found)) == [
        "mappings/lx200/surface.toml: [GR]: kept, and yet (autostar on cpc/4.10 and 1 more)"
    ]


def test_what_is_explained_is_what_the_mount_was_sent() -> None:
    told = explain("lx200gps", "cge", ":TL#").text  # FFFD hexadecimal is the lunar rate of the azimuth motor
    assert "to the mount: P\\x03\\x10\\x06\\xff\\xfd\\x00\\x00  variable rate" in told
    assert explain("lx200", "cge", "\\x06").text.endswith("reply: P  (polar)")
    small = explain("lx200", "gt/101.0", ":Mn#").text
    assert "to the mount: R" in small and "P\\x02" not in small
    assert "to the mount: and so on" in small
    home = explain("lx200gps", "6se", ":hF#").text
    assert "after :hS#, with the Crab nebula" in home and "No home position" not in home


def test_a_read_is_explained_with_what_the_mount_is_asked() -> None:
    assert "to the mount: e  precise" in explain("nexstar", "cpc", "e").text
    told = explain("lx200", "lx200gps", ":GVP#").text  # no model is named: the mount itself is what programs see
    assert "answered by the mount itself" in told and told.endswith("reply: LX2001#")
    assert explain("nexstar", "lx200:lx200", "m").text.endswith("\\x09#  (cpc)")  # a polar Meade: a CPC on a wedge


@each(
    ("words", "device"),
    [
        ("6se", "nexstar:6-8se"),
        ("NexStar 8SE", "nexstar:6-8se"),
        ("cpc", "nexstar:cpc"),
        ("CPC/4.10", "nexstar:cpc/4.10"),
        ("lx200gps", "lx200:lx200gps"),
        ("lx200", "lx200"),
        ("Celestron AVX", "nexstar:avx"),
        ("nexstar:cge/3.02", "nexstar:cge/3.02"),
        ("LX200 Classic", "lx200:lx200"),
        ("nexstar-gps", "nexstar:nexstar-gps"),
        ("evo", "nexstar:evolution"),
    ],
)
def test_a_mount_is_known_by_the_word_on_it(words: str, device: str) -> None:
    assert str(parse_device(words)) == f"{device}@"


def test_a_word_that_is_on_no_mount_is_refused() -> None:
    with pytest.raises(UserError, match=r"no protocol .* and no model; did you mean 'cgx'"):
        parse_device("cgx9")
