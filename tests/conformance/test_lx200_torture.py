"""Bytes that upset parsers, with exact replies, typed by hand; each whole, byte by byte, and with something behind."""

from __future__ import annotations

import re

from gateway.protocols.lx200.framing import Lx200Framer
from tests.support.each import each
from tests.support.fake_mount import Talk
from tests.support.manual_files import raw, rows

CASES = rows("lx200_torture.txt")


def _expected(text: str) -> re.Pattern[bytes]:
    return re.compile(b"".join(b".+" if part == "~" else re.escape(raw(part)) for part in re.split("(~)", text)), re.S)


@each("packets, reply", CASES)
def test_lx200_surface_gives_the_exact_reply_to_malformed_bytes(packets: str, reply: str) -> None:
    expected = _expected("" if reply == "-" else reply)
    pieces = [raw(piece) for piece in packets.split(" , ")]
    ways = {
        "as typed": pieces,
        "whole": [b"".join(pieces)],
        "byte by byte": [bytes((byte,)) for byte in b"".join(pieces)],
    }
    for way, chunks in ways.items():
        talk = Talk()
        assert expected.fullmatch(answer := b"".join(talk.send(chunk) for chunk in chunks)), (way, answer)
    talk = Talk()
    answer = talk.send(b"".join(pieces) + b"#:Gc#")
    assert expected.fullmatch(answer.removesuffix(b"24#").removesuffix(b"12#")), ("with trailing bytes", answer)


def test_lx200_surface_reads_a_command_after_four_kilobytes_of_garbage() -> None:
    framer = Lx200Framer()
    assert framer.feed(bytes(range(1, 6)) * 800 + b":" + b"A" * 4096, 0.0) == []
    assert framer.feed(b":GR#", 0.0) == [b":GR#"]
