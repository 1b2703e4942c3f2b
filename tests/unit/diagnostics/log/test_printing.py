"""What repeats is counted, what does anything is shown: the log of a whole gateway on virtual time."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from gateway.core.wire_log import Entry
from gateway.diagnostics.log.layout import Row
from gateway.diagnostics.log.printing import RowBuilder
from tests.support.in_process_gateway import Bridge


class Log:
    """The rows that the log of a bridge shows."""

    def __init__(self, bridge: Bridge, shown: str = "all") -> None:
        self.rows: list[Row] = []
        rows = RowBuilder("nexstar", ["lx200"], shown)
        bridge.wire_log.sinks.append(lambda entry: self.rows.extend(rows.process(entry)))

    def of(self, side: str) -> list[str]:
        """What is told of one side: arrow and bytes, or arrow and words."""
        return [
            f"{row.arrow} {row.data.decode('latin-1') or row.text}" for row in self.rows if row.side.startswith(side)
        ]


async def _poll(client: Any, seconds: float) -> None:
    for _ in range(int(2 * seconds)):
        await client.ask(b":GR#", ending=b"#")
        await client.ask(b":GD#", ending=b"#")
        await asyncio.sleep(0.5)


async def test_log_folds_a_program_that_polls_twice_a_second_into_a_few_lines() -> None:
    async with Bridge() as bridge:
        client, log = bridge.client("127.0.0.1:5"), Log(bridge)
        await _poll(client, 30.0)
        entries = sum(entry.arrow in "<>" for entry in bridge.entries)
        assert entries > 300
        assert len(log.rows) < 40
        first = log.of("127.")[:4]
        assert first == ["> :GR#", "< 06:21:28#", "> :GD#", "< +00*00:00#"]
        counts = [row.text for row in log.rows if row.arrow == "=" and row.data == b":GR#"]
        assert len(counts) >= 2
        assert all(words.endswith("now GR: RA 06:21:28") for words in counts)
        assert sum(int(words.split()[0]) for words in counts) >= 40


async def test_log_shows_every_move_and_setting_even_between_folded_polls() -> None:
    async with Bridge() as bridge:
        client, log, normal = bridge.client("127.0.0.1:5"), Log(bridge), Log(bridge, "normal")
        await _poll(client, 2.0)
        for _ in range(3):
            await client.ask(b":Sr05:34:32#")
        assert normal.of("127.") == [row for row in log.of("127.") if row[0] != "="]
        assert log.of("127.")[4:] == [
            "= repeated: :GR# ×3, :GD# ×3",
            "> :Sr05:34:32#",
            "< 1",
            "> :Sr05:34:32#",
            "< 1",
            "> :Sr05:34:32#",
            "< 1",
        ]
        log.rows.clear()
        await client.ask(b":GR#", ending=b"#")
        assert log.of("127.") == ["> :GR#", "< 06:21:28#"]
        client.send(b":RM#:Me#")
        await asyncio.sleep(0.5)
        client.send(b":Qe#")
        await asyncio.sleep(1.0)
        sent = [row.data for row in log.rows if row.side == "mount" and row.arrow == ">"]
        assert [data for data in sent if data[:1] in b"PT"] == [
            b"T\0",
            b"P\2\x10\x25\7\0\0\0",
            b"P\2\x10\x24\0\0\0\0",
            b"T\1",
        ]


async def test_log_shows_a_changed_answer_at_once() -> None:
    async with Bridge() as bridge:
        client, log = bridge.client("127.0.0.1:5"), Log(bridge)
        await client.ask(b":Sr07:00:00#")
        await client.ask(b":Sd+10*00:00#")
        assert await client.ask(b":MS#") == b"0"
        for _ in range(60):
            await client.ask(b":D#", ending=b"#")
            await asyncio.sleep(0.5)
        told = [row.text for row in log.rows if row.side.startswith("127.") and row.arrow == "<"]
        assert told[-2:] == ["D: the slew is under way", "D: the slew is done"]


def test_log_does_not_fold_an_unanswered_request() -> None:
    rows = RowBuilder("lx200", ["lx200"])
    shown: list[Row] = []
    for second in range(3):
        shown += rows.process(Entry(float(second), "mount", ">", b":GR#"))
        if second < 1:
            shown += rows.process(Entry(second + 0.1, "mount", "<", b"05:34:32#"))
    shown += rows.process(Entry(9.0, "mount", "!", b"", "the mount does not answer"))
    assert [(row.arrow, row.data) for row in shown] == [
        (">", b":GR#"),
        ("<", b"05:34:32#"),
        (">", b":GR#"),
        (">", b":GR#"),
        ("!", b""),
    ]


def test_log_shows_a_garbled_answer() -> None:
    rows = RowBuilder("lx200", ["lx200"])
    shown: list[Row] = []
    for second, reply in enumerate([b"05:34:32#", b"05:34:33#", b"05:%4:34#"]):
        shown += rows.process(Entry(float(second), "mount", ">", b":GR#"))
        shown += rows.process(Entry(second + 0.1, "mount", "<", reply, "dropped: garbled" if b"%" in reply else ""))
    assert [row.data for row in shown if row.data] == [b":GR#", b"05:34:32#", b":GR#", b"05:%4:34#"]
    assert shown[-1].text == "dropped: garbled"


def test_log_folds_a_program_with_one_connection_per_request() -> None:
    rows = RowBuilder("nexstar", ["lx200"])
    shown: list[Row] = []
    for second in range(30):
        side = f"192.168.1.9:{50000 + second}"
        shown += rows.process(Entry(float(second), side, "+", b"", "surface 1, host 192.168.1.9"))
        shown += rows.process(Entry(second + 0.1, side, ">", b":GR#"))
        shown += rows.process(Entry(second + 0.1, side, "<", b"05:34:32#"))
        if second == 15:
            shown += rows.process(Entry(second + 0.2, side, ">", b":Q#"))
        shown += rows.process(Entry(second + 0.3, side, "-", b""))
    assert [row.arrow for row in shown] == ["+", ">", "<", "-", "=", "=", "+", ">", "-", "+", ">", "<", "-", "="]


def test_log_separates_two_programs_of_one_computer() -> None:
    rows = RowBuilder("nexstar", ["lx200"])
    shown: list[Row] = []
    for port in (1, 2):
        shown += rows.process(Entry(0.0, f"127.0.0.1:{port}", "+", b"", "surface 1, host 127.0.0.1"))
    for port in (1, 2):
        shown += rows.process(Entry(1.0, f"127.0.0.1:{port}", ">", b":GR#"))
        shown += rows.process(Entry(1.0, f"127.0.0.1:{port}", "<", b"05:34:32#"))
    assert [row.arrow for row in shown] == ["+", "+", ">", "<", ">", "<"]


@pytest.mark.parametrize(
    ("shown", "sides", "told"),
    [
        ("program", {"127.0.0.1:5"}, [b":GR#", b"06:21:28#", b":Sr05:34:32#", b"1", b":Sr99#", b"0"]),
        ("mount", {"mount"}, []),
        ("changes", {"127.0.0.1:5"}, [b":Sr05:34:32#", b"1", b":Sr99#", b"0"]),
        ("refusals", {"127.0.0.1:5"}, [b":Sr99#", b"0"]),
    ],
)
async def test_log_leaves_out_kinds_that_are_not_selected(shown: str, sides: set[str], told: list[bytes]) -> None:
    async with Bridge() as bridge:
        log, client = Log(bridge, shown), bridge.client("127.0.0.1:5")
        for said in (b":GR#", b":GR#", b":Sr05:34:32#", b":Sr99#"):
            await client.ask(said)
        await asyncio.sleep(10.0)
        assert {row.side for row in log.rows} == sides
        assert [row.data for row in log.rows if row.side.startswith("127.") and row.data] == told


async def test_log_shows_a_goto_of_a_program_and_its_mount_command() -> None:
    async with Bridge() as bridge:
        log, client = Log(bridge, "changes"), bridge.client("127.0.0.1:5")
        for said in (b":Sr05:34:32#", b":Sd+22*00:52#", b":MS#", b":GR#"):
            await client.ask(said)
        assert [row.data for row in log.rows if row.data] == [
            b":Sr05:34:32#", b"1", b":Sd+22*00:52#", b"1", b":MS#", b"r3B78FC00,0FA79B00", b"#", b"0",
        ]  # fmt: skip


def test_log_does_not_guess_a_protocol_from_incomplete_bytes() -> None:
    """The log began after the connection: its first bytes are no command, and those after them are one of LX200."""
    rows = RowBuilder("nexstar", [])
    told = [row for data in (b"\x07\x07rubbish", b":GR#") for row in rows.process(Entry(1.0, "127.0.0.1:5", ">", data))]
    assert [row.kind for row in told] == ["program", "program"] and "right ascension" in told[1].text
