"""Numbers, truth values, times and text as JSON and programming languages write them, to bytes and back.

Numbers are written with all digits. Parsers are lenient (``true`` and ``True``, a time with or without its zone), and
raise ``ValueError`` for anything that is not such a value.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from urllib.parse import quote, unquote

import msgspec

from gateway.core.wire_log import printable

_TRUTH = {b"true": True, b"false": False}
_UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
#: The first second of the year 1 and the last of the year 9999, Unix time.
_FIRST_SECOND, _LAST_SECOND = -62_135_596_800.0, 253_402_300_799.0
#: The most digits of a whole number, leading zeros included; and the numbers of 32 bits.
_MAX_DIGITS, _WHOLE_RANGE = 12, range(-(2**31), 2**31)


def number(value: float) -> bytes:
    """Write a number with all its digits."""
    return repr(float(value)).encode("ascii")


def parse_number(raw: bytes) -> float:
    """Parse a finite decimal number without digit separators."""
    text = raw.decode("ascii")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if "_" in text or not math.isfinite(value):
        raise ValueError(f"{text!r} is not a number")
    return value


def hours(degrees: float) -> bytes:
    """Write an angle in degrees as decimal hours in [0, 24)."""
    return number(round(degrees / 15.0, 12) % 24.0)


def parse_hours(raw: bytes) -> float:
    """Parse decimal hours and return degrees, which may be outside [0, 360)."""
    return parse_number(raw) * 15.0


def parse_whole(raw: bytes) -> int:
    """Parse a whole number of 32 bits, with or without a sign."""
    digits = raw[1:] if raw[:1] in (b"-", b"+") else raw
    if not digits.isdigit() or len(digits) > _MAX_DIGITS or int(raw) not in _WHOLE_RANGE:
        raise ValueError(f"'{printable(raw)}' is not a whole number of 32 bits")
    return int(raw)


def parse_truth(raw: bytes) -> bool:
    """Parse ``true`` or ``false`` in upper or lower case."""
    try:
        return _TRUTH[raw.lower()]
    except KeyError:
        raise ValueError(f"'{printable(raw)}' is neither true nor false") from None


def moment(unix: float) -> bytes:
    """Write Unix seconds as UTC with milliseconds, limited to the years 1 to 9999: ``2026-01-28T21:00:00.000Z``."""
    at = _UNIX_EPOCH + timedelta(milliseconds=round(max(_FIRST_SECOND, min(_LAST_SECOND, unix)) * 1000.0))
    return at.replace(tzinfo=None).isoformat(timespec="milliseconds").encode() + b"Z"


def parse_moment(raw: bytes) -> float:
    """Parse an ISO date and time and return Unix seconds; without a zone it is UTC."""
    try:
        at = datetime.fromisoformat(unquote(raw.decode("ascii")))
        return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()
    except OverflowError as error:
        raise ValueError(str(error)) from None


def quote_text(text: str) -> bytes:
    """Write text percent-encoded as in a URL, so that it contains no blanks."""
    return quote(text, safe="+-.:,TZ").encode("ascii")


def parse_json(raw: bytes) -> object:
    """Parse a line of JSON."""
    try:
        value: object = msgspec.json.decode(raw)
    except msgspec.DecodeError as error:
        raise ValueError(str(error)) from None
    return value
