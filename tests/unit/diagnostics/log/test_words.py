"""What a command carries and a reply tells, in words: in the log and by ``decode``, by the tables alone."""

from __future__ import annotations

import pytest

from gateway.core.wire_log import Entry
from gateway.diagnostics.log.conversation import ConnectionDecoder
from gateway.diagnostics.log.printing import RowBuilder
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each

#: Protocol, command, its words, reply, its words; the bytes are those of the manuals.
SAID = [
    (
        "nexstar",
        b"e",
        "precise right ascension and declination",
        b"34AB0500,12CE0500#",
        "e: RA 04:56:15, Dec +26°26'39\"",
    ),
    ("nexstar", b"E", "right ascension and declination", b"34AB,F2CE#", "E: RA 04:56:15, Dec -18°33'21\""),
    (
        "nexstar",
        b"r3B78FC00,0FA79B00",
        "precise goto right ascension and declination: RA 05:34:32, Dec +22°00'52\"",
        b"#",
        "r: accepted",
    ),
    (
        "nexstar",
        b"T\x02",
        "set tracking mode: mode 2: EQ north (CGE, Advanced GT 3.01-3.04: EQ south; SynScan: EQ)",
        b"#",
        "T: accepted",
    ),
    (
        "nexstar",
        b"P\x02\x10\x24\x09\0\0\0",
        "fixed rate, azimuth or right ascension, positive: rate 9",
        b"#",
        "slew_azm_pos: accepted",
    ),
    (
        "nexstar",
        b"P\x03\x11\x07\x02\x58\0\0",
        "variable rate, altitude or declination, negative: rate 150 arcsec/s",
        b"#",
        "rate_alt_neg: accepted",
    ),
    (
        "nexstar",
        b"W\x21\x32\x29\0\x76\x14\x11\1",
        "set location: latitude 33°50'41\" N, longitude 118°20'17\" W",
        b"#",
        "W: accepted",
    ),
    ("nexstar", b"h", "local time, zone", b"\x0f\x1a\0\x04\x06\x05\xf8\1#", "h: 2005-04-06 15:26:00, zone -8, dst 1"),
    ("nexstar", b"m", "model", b"\x0c#", "m: 6-8se"),
    ("nexstar", b"V", "hand-control version", b"\x04\x15#", "V: version 4.21"),
    ("nexstar", b"J", "whether the alignment is complete", b"\0#", "J: not aligned"),
    ("nexstar", b"L", "whether a goto is in progress", b"1#", "L: a goto is in progress"),
    ("lx200", b":GR#", "right ascension of the telescope", b"05:34:32#", "GR: RA 05:34:32"),
    ("lx200", b":GD#", "declination of the telescope", b"-00*30:00#", "GD: Dec -00°30'00\""),
    ("lx200", b":Sr05:34:32#", "set the target right ascension: RA 05:34:32", b"1", "Sr: accepted"),
    ("lx200", b":Sr05:34:32#", "set the target right ascension: RA 05:34:32", b"0", "Sr: Invalid value."),
    ("lx200", b":MS#", "slew to the target", b"1Object Below Horizon.  #", "MS: Object Below Horizon."),
    ("lx200", b":Mgw0500#", "guide in a direction, milliseconds: west, for 500 ms", b"", ""),
    ("lx200", b":Sg011*36#", "set the site longitude, west positive: longitude 11°36'00\" W", b"1", "Sg: accepted"),
    ("lx200", b":SG-01.0#", "set hours to add for UTC: local time is UTC+1 h", b"1", "SG: accepted"),
    ("lx200", b":D#", "distance bars", b"#", "D: the slew is done"),
    ("lx200", b":GW#", "mounting, tracking and alignment state", b"PT2#", "GW: polar, tracking, aligned on two stars"),
    ("lx200", b"\x06", "alignment mode", b"A", "ACK: alt-az"),
    ("lx200", b":GVP#", "name of the product", b"LX2001\x1b#", 'GVP: "LX2001\\x1b"'),
]


@each(("protocol", "command", "words", "reply", "answer"), SAID)
def test_log_describes_commands_and_replies_in_words(
    protocol: str, command: bytes, words: str, reply: bytes, answer: str
) -> None:
    side = ConnectionDecoder(protocol)
    assert side.describe_command(command).text == words
    if reply:
        assert side.describe_reply_to_last(reply).text == answer


@pytest.mark.parametrize("protocol", ["lx200", "nexstar"])
def test_no_command_that_sets_or_moves_is_classified_as_a_read(protocol: str) -> None:
    table = load(protocol)
    acting = {
        name
        for name, command in table.commands.items()
        if not command.is_query and any(picture.fields for _, picture in command.replies)
    }
    assert acting == ({"CM", "P", "MS", "SC"} if protocol == "lx200" else set())
    does = ("Set", "Goto", "Move", "Sync", "Stop", "Abort", "Park", "Pulse", "Focus")
    for name, row in table.surface_rows.items():
        if table.commands[name].is_query:
            assert not [one for one in row.operations if one.startswith(does)]


def test_every_row_of_log_descriptions_names_an_existing_field_or_command() -> None:
    for protocol in ("lx200", "nexstar"):
        table = load(protocol)
        fields = {
            name: {
                field
                for picture in [*command.requests, *(one for _, one in command.replies)]
                for field in picture.fields
            }
            for name, command in table.commands.items()
        }
        rows = table.extra_table("words.toml")
        assert set(rows.get("commands", {})) <= set(fields)
        for name in rows["fields"]:
            command, dot, field = name.rpartition(".")
            assert field in (fields[command] if dot else set().union(*fields.values())), name


def test_log_shows_unknown_bytes_as_bytes() -> None:
    side = ConnectionDecoder("lx200")
    assert side.describe_command(b":XX#").text == "not a command of the lx200 protocol"
    assert side.describe_reply_to_last(b"\xffwhat").text == ""


def test_log_does_not_infer_a_protocol_from_a_reply_to_an_earlier_program() -> None:
    """The log may begin between a command and its reply; the next command is understood all the same."""
    rows, side = RowBuilder("nexstar", ["lx200"]), "1.2.3.4:5"
    entries = [
        Entry(0.0, side, "<", b"-10*19:29#"),
        Entry(1.0, side, ">", b":GD#"),
        Entry(1.1, side, "<", b"+01*00:00#"),
    ]
    shown = [row for entry in entries for row in rows.process(entry)]
    assert [row.kind for row in shown] == ["program"] * 3
    assert [row.text.partition(" ")[0] for row in shown] == ["", "declination", "GD:"]
