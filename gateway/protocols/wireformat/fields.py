"""The codecs of all field formats, which convert bytes to values and back.

A codec is named by the format as the manual writes it. Output is exact: the value is rounded once to the field's unit,
wrapped, then split, so that `:60`, `24:00:00` and a lost `-00` cannot occur. Input is lenient where real programs
deviate (any separator, missing seconds, other widths) and raises ``ValueError`` for a value out of range. Angles are
degrees (right ascension too), times of day are seconds, UTC offsets are hours.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, NamedTuple
from urllib.parse import unquote

import msgspec

from gateway.core.wire_log import printable
from gateway.protocols.wireformat import numerals
from gateway.protocols.wireformat import sexagesimal as sx


class Codec(NamedTuple):
    """One field format. ``pattern`` matches the bytes of the field; ``length`` is its number of bytes if fixed."""

    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], object]
    pattern: bytes
    length: int | None = None


# --- text: sexagesimal ----------------------------------------------------------------------------------------

_UNTIL_HASH = rb"[^#]*"  # any bytes up to the terminator of an LX200 frame
_HEX = re.compile(rb"[0-9A-Fa-f]*").fullmatch


def _checking_range(decode: Callable[[bytes], float], low: float, high: float) -> Callable[[bytes], float]:
    """Wrap ``decode``: the wrapper raises ValueError unless the value is in [low, high]."""

    def checked(raw: bytes) -> float:
        value = decode(raw)
        if not low <= value <= high:
            raise ValueError(f"'{printable(raw)}' is not from {low:g} to {high:g}")
        return value

    return checked


def _sexagesimal(encode: Callable[[float], str], decode: Callable[[bytes], float], low: float, high: float) -> Codec:
    return Codec(lambda value: encode(value).encode("ascii"), _checking_range(decode, low, high), _UNTIL_HASH)


_BELOW_FULL_TURN = 360.0 - 1e-9  # degrees
_TEXT_ANGLE_FORMATS = {
    "HH:MM:SS": _sexagesimal(sx.hours, sx.parse_hours, 0, _BELOW_FULL_TURN),
    "HH:MM:SS.SSSS": _sexagesimal(sx.hours_fine, sx.parse_hours, 0, _BELOW_FULL_TURN),
    "HH:MM.T": _sexagesimal(sx.hours_low, sx.parse_hours, 0, _BELOW_FULL_TURN),
    "sDD*MM:SS": _sexagesimal(sx.signed, sx.parse, -90, 90),
    "sDD*MM:SS.SSS": _sexagesimal(sx.signed_angle_fine, sx.parse, -90, 90),
    "sDD*MM": _sexagesimal(sx.signed_angle_low, sx.parse, -90, 90),
    "DDD*MM:SS": _sexagesimal(sx.azimuth, sx.parse_azimuth, 0, _BELOW_FULL_TURN),
    "DDD*MM": _sexagesimal(sx.azimuth_low, sx.parse_azimuth, 0, _BELOW_FULL_TURN),
    "sDDD*MM": _sexagesimal(sx.longitude, sx.parse_longitude, -180, 180),
    "hh:mm:ss": _sexagesimal(sx.clock, sx.parse_clock, 0, 86400),
    "hh:mm:ss 12h": _sexagesimal(sx.clock_12, sx.parse_clock, 0, 86400),
    # The longitude in the manual's command to set a site: unsigned, 0 to 360 degrees west. Signed input is accepted.
    "DDD*MM west": _sexagesimal(sx.azimuth_low, sx.parse_longitude, -180, 180),
    # A lunar longitude beyond 180 degrees is not another way to write a western one.
    "sDDD*MM moon": _sexagesimal(sx.longitude, sx.parse, -180, 180),
}

# --- text: numbers and words ----------------------------------------------------------------------------------


def _number(
    name: str, decimals: int, width: int, signed: bool, low: float, high: float, max_digits: int | None = None
) -> Codec:
    """Return the codec of a decimal number, with zeros to ``width`` digits before the point, ``decimals`` after it.
    Input must be from ``low`` to ``high``. Output has at most ``max_digits`` characters; None: those of the format.
    """
    full = width + (decimals + 1 if decimals else 0) + (1 if signed else 0)
    form = f"{{:{'+' if signed else ''}0{full}.{decimals}f}}"

    def encode(value: float) -> bytes:
        text = form.format(round(float(value), decimals) + 0.0)
        if len(text) > (max_digits or full):
            raise ValueError(f"{value!r} does not fit {name}")
        return text.encode("ascii")

    within = _checking_range(sx.number, low, high)

    def decode(raw: bytes) -> float:
        value = within(raw if signed else sx.require_unsigned(raw))
        return value if decimals else int(sx.require_whole(raw))

    return Codec(encode, decode, _UNTIL_HASH)


def _with_arcminute_sign(codec: Codec) -> Codec:
    """Wrap the codec of a number: a unit sign for arcminutes follows it, which clients may omit."""
    return Codec(
        lambda value: codec.encode(value) + b"'", lambda raw: codec.decode(raw.rstrip(b"*'\xdf\xb0\xc2 ")), _UNTIL_HASH
    )


def _choice(choices: str) -> Codec:
    """Return the codec of a field with a choice of words, as in ``{mode:A|L|P}``."""
    allowed = [word.encode("latin-1") for word in choices.split("|")]

    def encode(value: str) -> bytes:
        raw = value.encode("latin-1")
        if raw not in allowed:
            raise ValueError(f"{value!r} is not one of {choices}")
        return raw

    pattern = b"|".join(re.escape(word) for word in sorted(allowed, key=len, reverse=True))
    widths = {len(word) for word in allowed}
    width = widths.pop() if len(widths) == 1 else None
    return Codec(encode, lambda raw: raw.decode("latin-1"), b"(?:" + pattern + b")", width)


_TEXT_CODEC = Codec(
    lambda value: value.encode("latin-1", "replace").replace(b"#", b" "), lambda raw: raw.decode("latin-1"), _UNTIL_HASH
)

_OTHER_TEXT_FORMATS = {
    "sHH.H": Codec(lambda value: sx.utc_offset(value).encode("ascii"), sx.parse_utc_offset, _UNTIL_HASH),
    "sHH.H in full": Codec(lambda value: sx.offset_in_full(value).encode("ascii"), sx.parse_utc_offset, _UNTIL_HASH),
    "sHH:MM": Codec(lambda value: sx.offset_with_minutes(value).encode("ascii"), sx.parse_utc_offset, _UNTIL_HASH),
    "MM/DD/YY": Codec(lambda value: sx.date(value).encode("ascii"), sx.parse_date, _UNTIL_HASH),
    "sMM.M": _number("sMM.M", 1, 2, True, -30, 30),
    "NNN": _number("NNN", 0, 3, False, 0, 999),
    "NNN'": _with_arcminute_sign(_number("NNN", 0, 3, False, 0, 999)),
    "NNNN": _number("NNNN", 0, 4, False, 0, 999999, max_digits=6),
    "DD*": Codec(lambda value: b"%02d*" % round(value), sx.parse_limit, _UNTIL_HASH),
    "DD* to set": Codec(lambda value: b"%02d*" % round(value), sx.parse_new_limit, _UNTIL_HASH),
    "DD to set": Codec(lambda value: b"%02d" % round(value), sx.parse_new_limit, _UNTIL_HASH),
    "N": _number("N", 0, 1, False, 2, 8),
    # an LX200GPS says +60.1
    "TT.T": _number("TT.T", 1, 2, False, 0, 99.9)._replace(decode=_checking_range(sx.number, 0, 99.9)),
    "TTT.T": _number("TTT.T", 1, 3, False, 0, 999.9),
    "DDD.DDD": _number("DDD.DDD", 3, 3, False, 0, 999.999),
    "DD.D": _number("DD.D", 1, 2, False, 0, 99.9),
    "SS.S": _number("SS.S", 1, 2, False, 0, 99.9),
    "sdd.ddd": _number("sdd.ddd", 3, 2, True, -99, 99),
    "dd": _number("dd", 0, 2, False, 0, 99),
    "dddd": _number("dddd", 0, 4, False, 0, 999999, max_digits=6),
    "n": _number("n", 0, 1, False, 0, 9),
    "nn": _number("nn", 0, 1, False, 0, 99, max_digits=2),
    "text": _TEXT_CODEC,
}

# --- binary and hexadecimal: NexStar --------------------------------------------------------------------------


def _hex_turn(bits: int, used_bits: int, signed: bool) -> Codec:
    """Return the codec of degrees as a hexadecimal fraction of a revolution; all but ``used_bits`` upper bits are 0."""
    digits, spare = bits // 4, bits - used_bits

    def encode(value: float) -> bytes:
        ticks = round(value / 360.0 * (1 << used_bits)) % (1 << used_bits)
        return b"%0*X" % (digits, ticks << spare)

    def decode(raw: bytes) -> float:
        # a client may pad the unused low byte with anything
        number = int(raw, 16) if _HEX(raw) else int(raw[: used_bits // 4], 16) << spare
        ticks = (number + (1 << spare >> 1)) >> spare
        return _degrees(ticks, used_bits, signed)

    pattern = b"[0-9A-Fa-f]{%d}" % (used_bits // 4) + (b"(?s:.{%d})" % (spare // 4) if spare else b"")
    return Codec(encode, decode, pattern, digits)


def _degrees(ticks: int, bits: int, signed: bool) -> float:
    ticks %= 1 << bits
    if signed and ticks >= 1 << (bits - 1):
        ticks -= 1 << bits
    return ticks * 360.0 / (1 << bits)


def _binary_turn(bits: int, signed: bool) -> Codec:
    """Return the codec of an angle in degrees as a binary fraction of a revolution, most significant byte first."""
    width = bits // 8

    def encode(value: float) -> bytes:
        return (round(value / 360.0 * (1 << bits)) % (1 << bits)).to_bytes(width, "big")

    return Codec(encode, lambda raw: _degrees(int.from_bytes(raw, "big"), bits, signed), b"(?s:.{%d})" % width, width)


def _integer(length: int, signed: bool = False) -> Codec:
    """Return the codec of a binary integer of ``length`` bytes, most significant byte first."""

    def encode(value: int) -> bytes:
        try:
            return int(value).to_bytes(length, "big", signed=signed)
        except OverflowError:
            raise ValueError(f"{value!r} does not fit {length} byte(s)") from None

    return Codec(encode, lambda raw: int.from_bytes(raw, "big", signed=signed), b"(?s:.{%d})" % length, length)


def _little_endian(codec: Codec) -> Codec:
    """Wrap a codec: the least significant byte comes first."""
    return codec._replace(encode=lambda value: codec.encode(value)[::-1], decode=lambda raw: codec.decode(raw[::-1]))


_BINARY_FORMATS = {
    "rev16": _hex_turn(16, 16, signed=False),
    "srev16": _hex_turn(16, 16, signed=True),
    "rev32": _hex_turn(32, 24, signed=False),
    "srev32": _hex_turn(32, 24, signed=True),
    "rev24": _binary_turn(24, signed=False),
    "hex": Codec(lambda value: b"%02X" % value, lambda raw: int(raw, 16), b"[0-9A-Fa-f]{2}", 2),
    "srev24": _binary_turn(24, signed=True),
    "u8": _integer(1),
    "s8": _integer(1, signed=True),
    "u16": _integer(2),
    "u24": _integer(3),
    "u32": _integer(4),
    "u64 LE": _little_endian(_integer(8)),
    "s32 LE": _little_endian(_integer(4, signed=True)),
    "turn32 LE": _little_endian(_binary_turn(32, signed=False)),
    "turn32 signed LE": _little_endian(_binary_turn(32, signed=True)),
    "latitude": Codec(sx.dms_bytes, lambda raw: sx.parse_dms_bytes(raw, 90), b"(?s:.{4})", 4),
    "longitude": Codec(sx.dms_bytes, lambda raw: sx.parse_dms_bytes(raw, 180), b"(?s:.{4})", 4),
    "char": Codec(lambda value: value.encode("latin-1"), lambda raw: raw.decode("latin-1"), b"(?s:.)", 1),
}

# --- text of one line: whole numbers and fractions as programming languages write them ----------------------------

_UNTIL_BLANK = rb"[^ \n]*"  # any bytes up to a blank or the end of the line
_LINE_FORMATS = {
    "number": Codec(numerals.number, numerals.parse_number, _UNTIL_BLANK),
    "hours": Codec(numerals.hours, numerals.parse_hours, _UNTIL_BLANK),
    "whole": Codec(lambda value: b"%d" % value, numerals.parse_whole, _UNTIL_BLANK),
    "truth": Codec(lambda value: b"true" if value else b"false", numerals.parse_truth, _UNTIL_BLANK),
    "moment": Codec(numerals.moment, numerals.parse_moment, _UNTIL_BLANK),
    "quoted": Codec(numerals.quote_text, lambda raw: unquote(raw.decode("ascii")), _UNTIL_BLANK),
    "json": Codec(msgspec.json.encode, numerals.parse_json, rb"[^\n]*"),
}

CODECS: dict[str, Codec] = {**_TEXT_ANGLE_FORMATS, **_OTHER_TEXT_FORMATS, **_BINARY_FORMATS, **_LINE_FORMATS}


def codec(name: str) -> Codec:
    """Return the codec of a field format; a format with ``|`` is a choice of words. Raises KeyError if unknown."""
    if name not in CODECS and "|" in name:
        CODECS[name] = _choice(name)
    return CODECS[name]
