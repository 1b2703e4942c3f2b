"""The log of a port for every protocol: what a connection turns out to speak is told with it, and folded with it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from gateway.core.wire_log import Entry
from gateway.diagnostics.log.printing import RowBuilder


def visits(count: int) -> Iterator[Entry]:
    """A program that opens a connection for every question."""
    for number in range(count):
        side, at = f"10.0.0.1:{5000 + number}", float(number)
        yield Entry(at, side, "+", b"", "surface 1, host 10.0.0.1")
        yield Entry(at, side, "~", b"", "nexstar")
        yield Entry(at, side, ">", b"e")
        yield Entry(at, side, "<", b"34AB0500,12CE0500#")
        yield Entry(at, side, "-", b"")


def shown(entries: Iterator[Entry], kept: str = "all") -> list[str]:
    rows = RowBuilder("lx200", ["any"], kept)
    return [f"{row.arrow} {row.text}".partition(",")[0] for entry in entries for row in rows.process(entry)]


def test_log_of_an_any_protocol_port_shows_the_first_poll_and_counts_the_rest() -> None:
    first = ["+ connected", "~ speaks nexstar", "> precise right ascension and declination", "< e: RA 04:56:15"]
    assert shown(visits(1))[:4] == first
    assert [row for row in shown(visits(20)) if row[0] in "+~"] == first[:2]


@pytest.mark.parametrize(("kept", "arrows"), [("refusals", ""), ("changes", "+~-")])
def test_log_of_an_any_protocol_port_shows_only_the_selected_kinds(kept: str, arrows: str) -> None:
    assert {row[0] for row in shown(visits(5), kept)} <= set(arrows)


def test_log_of_an_any_protocol_port_shows_a_refusal_with_the_protocol() -> None:
    entries = [*visits(1)]
    entries[3:4] = [Entry(0.5, "10.0.0.1:5000", "!", b"", "refused: why")]
    assert shown(iter(entries), "refusals")[:2] == ["+ connected", "~ speaks nexstar"]


def test_log_of_an_any_protocol_port_tells_why_a_protocol_was_chosen() -> None:
    silent = Entry(3.0, "10.0.0.1:5000", "~", b"", "stellarium, because the program has sent nothing for 3 s")
    rows = RowBuilder("lx200", ["any"])
    assert [row.text.partition(",")[0] for row in rows.process(silent)] == ["speaks stellarium"]
