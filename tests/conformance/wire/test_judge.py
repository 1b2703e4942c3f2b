"""The judge finds what a row says and the wire does not carry, and tells it once."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gateway.app.config import Endpoint
from gateway.diagnostics.command_outcomes import MountKind
from gateway.diagnostics.rehearsal.play import Play, PlayedStep
from gateway.protocols.base.surface import Surface
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Implementation, SurfaceRow
from tests.conformance.wire.judge import Case, differences
from tests.conformance.wire.rehearse import Difference, Pair, rehearse, report
from tests.conformance.wire.watcher import Seen

CPC = Pair(Endpoint("lx200", "-", "lx200gps"), Endpoint("nexstar", "-", "cpc", "4.21"))
OVER_MEADE = Pair(Endpoint("nexstar", "-", "cge", "4.21"), Endpoint("lx200", "-", "lx200gps"))


@pytest.mark.parametrize(
    ("pair", "name", "row", "says"),
    [
        (CPC, "GD", {"outcome": "kept", "call": "accessories.silence"}, "kept, and yet there is no reply"),
        (CPC, "GVP", {"outcome": "translated", "asks": ["GuideRate"]}, "the mount has never been asked"),
        (CPC, "GVP", {"outcome": "silent"}, "silent, and yet 'LX2001#' is said"),
        (CPC, "AL", {"outcome": "kept"}, "kept, and yet T goes to the mount"),
        (CPC, "B+", {"outcome": "kept"}, "kept, and nothing is kept"),
        (CPC, "Gr", {"outcome": "translated", "asks": ["Sync"]}, "nothing that changes the mount is sent"),
        (CPC, "Gr", {"outcome": "synthesised"}, "what is seen is kept"),
        (CPC, "GS", {"outcome": "synthesised"}, "what is seen is derived"),
        (CPC, "GVP", {"outcome": "derived"}, "what is seen is synthesised"),
        (CPC, "MS", {"asks": ["Sync"]}, "asks for Goto, and asks does not list it"),
        (CPC, "SS", {"outcome": "kept"}, "kept, and yet the reply is no: '0'"),
        (CPC, "SB", {"outcome": "refused"}, "refused, and the reply '1' is no no"),
        (CPC, "$QA+", {"why": None}, "no remark on it, and the log says"),
        (CPC, "AL", {"asks": ["Sync"]}, "T goes to the mount, and is not listed"),
        (OVER_MEADE, "pec_record", {"outcome": "kept"}, "kept, and yet the reply is no"),
    ],
)
def test_a_row_that_says_something_else_is_found(
    monkeypatch: pytest.MonkeyPatch, pair: Pair, name: str, row: dict[str, object], says: str
) -> None:
    rows: dict[str, SurfaceRow] = load(pair.face.protocol).surface
    monkeypatch.setitem(rows, name, replace(rows[name], **row))
    _, found = rehearse(pair, frozenset([name]))
    assert any(says in difference.words for difference in found), found


def test_a_way_that_is_not_taken_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(load("nexstar").driver, "SetSite", [Implementation(call="place.set_site", uses=["W"])])
    _, found = rehearse(CPC, frozenset(["Sg"]))
    assert {difference.words for difference in found} == {"translated, and nothing that changes the mount is sent"}


def test_a_mount_that_says_no_while_the_program_hears_yes_is_found() -> None:
    nexstar, protocol = load("nexstar"), load("lx200")
    surface = Surface(protocol, {})
    request = bytes((80, 2, 17, 36, 9, 0, 0, 0))  # P: move the altitude motor by key 9, no reply byte asked for

    def words(answer: bytes, *notes: PlayedStep) -> list[str]:
        events = (PlayedStep("act", "", request), PlayedStep("answer", "", answer), *notes, PlayedStep("reply", ""))
        row = protocol.commands["Mn"], protocol.surface["Mn"]
        case = Case(*row, frozenset(), nexstar, MountKind("cpc", (4, 21), aligned=True), False)
        return differences(case, Seen(Play(b":Mn#", events, b"", (request,)), learnt=True), surface, frozenset())

    assert words(b"#") == []
    assert words(b"\x00#") == ["the mount says no, and nobody is told"]  # one byte too many: no such device
    assert words(b"\x00#", PlayedStep("note", "Move: No such device on the mount.")) == []


def test_a_difference_is_told_once_with_the_pairs_that_show_it() -> None:
    found = [Difference("lx200", "GR", "kept, and yet", f"autostar on cpc/{text}") for text in ("4.10", "4.21")]
    assert list(report(found)) == ["mappings/lx200/surface.toml: [GR]: kept, and yet (autostar on cpc/4.10 and 1 more)"]
