"""Input for fuzzing: random bytes, real conversations with errors in them, and commands at their limits.

Every function takes the random generator to use, so that a seed repeats a run.
"""

from __future__ import annotations

import re
from functools import lru_cache
from random import Random

from gateway.protocols.wireformat.command_set import load
from tests.support.manual_files import raw, rows
from tests.support.transcript_files import files, read

_FIELD = re.compile(r"\{\w+:([^}]*)\}")
#: Separators between the digits of a field, as programs write them and as none does.
_SEPARATORS = ["*", ":", "\xdf", "'", " ", ".", "", "/", "-", "\xc2\xb0"]
_DIGITS = "0123456789"
_FLAWS = ("drop", "flip", "insert", "swap", "cut", "repeat")
KINDS = ("noise", "mutated", "limits")


@lru_cache
def conversations(protocol: str) -> list[bytes]:
    """Return every packet of the transcripts and of the manual's own tables, in order."""
    packets = [
        line.data for path in files(f"{protocol}-*.txt") for line in read(path).lines if line.mark == ">" and line.data
    ]
    tables = ["forms", "beyond", "torture"] if protocol == "lx200" else ["forms"]
    for table in tables:
        for row in rows(f"{protocol}_{table}.txt"):
            packets += [raw(piece) for piece in row[0 if table == "torture" else 1].split(" , ")]
    return packets


def noise(rng: Random, size: int) -> bytes:
    """Return random bytes; one time in eight only bytes that begin, fill or end commands."""
    if rng.random() < 0.875:
        return rng.randbytes(size)
    return bytes(rng.choices(b":#\x06$QGSMRDrdPEeZzWHTtKwhL0123456789+-*.,\x00\x10\x11\x24\xff", k=size))


def flawed(rng: Random, data: bytes) -> bytes:
    """Return the bytes with up to three errors as a line or a programmer makes them."""
    spoilt = bytearray(data)
    for _ in range(rng.randrange(4)):
        at = rng.randrange(len(spoilt) + 1)
        flaw = rng.choice(_FLAWS)
        if flaw == "insert" or not spoilt[at : at + 1]:
            spoilt[at:at] = rng.randbytes(rng.randint(1, 3))
        elif flaw == "drop":
            del spoilt[at]
        elif flaw == "flip":
            spoilt[at] ^= 1 << rng.randrange(8)
        elif flaw == "swap":
            spoilt[at : at + 2] = spoilt[at : at + 2][::-1]
        elif flaw == "cut":
            del spoilt[at:]
        else:
            spoilt[at:at] = spoilt[at : at + rng.randint(1, 40)]
    return bytes(spoilt)


def mutated(rng: Random, protocol: str, size: int) -> bytes:
    """Return stretches of real conversations with errors in them."""
    packets, data = conversations(protocol), b""
    while len(data) < size:
        first = rng.randrange(len(packets))
        for packet in packets[first : first + rng.randint(1, 12)]:
            data += packet if rng.random() < 0.5 else flawed(rng, packet)
    return data


def limits(rng: Random, protocol: str, size: int) -> bytes:
    """Return existing commands, with arguments at and beyond the limits of their fields."""
    command_rows, data = list(load(protocol).commands.values()), b""
    while len(data) < size:
        data += _filled(rng, rng.choice(rng.choice(command_rows).requests).source)
    return data


def _filled(rng: Random, source: str | list[str | int]) -> bytes:
    """Fill the fields of a request's template."""
    if isinstance(source, list):
        return b"".join(bytes((piece,)) if isinstance(piece, int) else _filled(rng, piece) for piece in source)
    pieces = _FIELD.split(source)  # text between fields alternates with the form of a field
    return b"".join(_argument(rng, piece) if n % 2 else piece.encode("latin-1") for n, piece in enumerate(pieces))


def _argument(rng: Random, form: str) -> bytes:
    """Return an argument for a field of that form."""
    binary = {"u8": 1, "s8": 1, "char": 1, "u16": 2, "u24": 3, "rev24": 3, "srev24": 3, "u32": 4, "latitude": 4,
              "longitude": 4}.get(form)  # fmt: skip
    if binary:
        edge = rng.choice([b"\0", b"\x7f", b"\x80", b"\xff", b"\x01", b""])
        small = bytes(rng.choice([0, 1, 2, 9, 12, 23, 31, 59, 60, 90, 99]) for _ in range(binary))
        return rng.choice([(edge * binary or rng.randbytes(binary)), small, rng.randbytes(binary)])
    if form.lstrip("s") in ("rev16", "rev32"):
        digits = 4 if form.endswith("16") else 8
        edges = ["0", "F", "7F", "8", "4", "C", "3FFFFFFF", "40000001", "BFFFFFFF"]
        text = rng.choice([(rng.choice(edges) + "0" * 8)[:digits], f"{rng.getrandbits(4 * digits):0{digits}X}"])
        return text.encode()
    if "|" in form:
        return rng.choice(form.split("|")).encode()
    if form == "text":
        return bytes(rng.choice([rng.randrange(0x20, 0x7F), rng.randrange(256)]) for _ in range(rng.randrange(20)))
    text = re.sub(r"[A-Za-z]+", lambda hit: _number(rng, hit.group()), form.partition(" ")[0])
    if rng.random() < 0.3:
        text = re.sub(r"[*:'.]", lambda hit: rng.choice([hit.group(), rng.choice(_SEPARATORS)]), text)
    return text.encode("latin-1")


def _number(rng: Random, letters: str) -> str:
    """Return digits for a run of letters; a small s is a sign."""
    sign = rng.choice(["+", "-", "", " "]) if letters[0] == "s" else ""
    width = len(letters.lstrip("s")) or 1
    width += rng.choice([0, 0, 0, 0, 1, -1, rng.randrange(30)])
    digits = rng.choice(["0" * width, "9" * width, "59"[:width], "60"[:width], "12"[:width],
                         "".join(rng.choices(_DIGITS, k=max(0, width)))])  # fmt: skip
    return sign + digits


def thrown(rng: Random, kind: str, protocol: str, size: int) -> bytes:
    """Return about this many bytes of that kind."""
    if kind == "noise":
        return noise(rng, size)
    return mutated(rng, protocol, size) if kind == "mutated" else limits(rng, protocol, size)


def packets(rng: Random, data: bytes) -> list[bytes]:
    """Cut the bytes at random places, as a line does."""
    longest, found, at = rng.choice([1, 8, 64, 300, 300, 300]), [], 0
    while at < len(data):
        size = rng.randint(1, longest)
        found.append(data[at : at + size])
        at += size
    return found
