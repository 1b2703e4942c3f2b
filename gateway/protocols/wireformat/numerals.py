"""Values as JSON and programming languages write them, each between bytes and what it means.

Numbers go out in full, so that nothing is lost on the way. What comes in is taken as people and programs write it
(``true`` and ``True``, a time with or without its zone); ``ValueError`` is raised for what is no such value.
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta
from urllib.parse import quote, unquote

import msgspec

_TRUTH = {b"true": True, b"false": False}
_BEGINNING = datetime(1970, 1, 1, tzinfo=UTC)
#: The first and the last second that have a date of four digits, Unix time.
_FIRST, _LAST = -62_135_596_800.0, 253_402_300_799.0
#: Whole numbers are those of 32 bits, which have no more digits.
_DIGITS, _WHOLE = 12, range(-(2**31), 2**31)


def number(value: float) -> bytes:
    """With as many digits as it has."""
    return repr(float(value)).encode("ascii")


def parse_number(raw: bytes) -> float:
    """A finite one, with a point and without digit separators."""
    text = raw.decode("ascii")
    value = float(text)
    if "_" in text or not math.isfinite(value):
        raise ValueError(f"{text!r} is no number")
    return value


def hours(degrees: float) -> bytes:
    """Degrees as hours, from 0 to below 24."""
    return number(round(degrees / 15.0, 12) % 24.0)


def parse_hours(raw: bytes) -> float:
    """Hours as degrees, whatever turn they are in."""
    return parse_number(raw) * 15.0


def parse_whole(raw: bytes) -> int:
    """Digits with a sign or without."""
    digits = raw[1:] if raw[:1] in (b"-", b"+") else raw
    if not digits.isdigit() or len(digits) > _DIGITS or int(raw) not in _WHOLE:
        raise ValueError(f"{raw!r} is no whole number of 32 bits")
    return int(raw)


def parse_truth(raw: bytes) -> bool:
    """The same words in any case."""
    try:
        return _TRUTH[raw.lower()]
    except KeyError:
        raise ValueError(f"{raw!r} is neither true nor false") from None


def moment(unix: float) -> bytes:
    """UTC to the millisecond, as far as calendars reach: ``2026-01-28T21:00:00.000Z``."""
    at = _BEGINNING + timedelta(milliseconds=round(max(_FIRST, min(_LAST, unix)) * 1000.0))
    return at.replace(tzinfo=None).isoformat(timespec="milliseconds").encode() + b"Z"


def parse_moment(raw: bytes) -> float:
    """Unix seconds; a time without a zone is UTC."""
    try:
        at = datetime.fromisoformat(unquote(raw.decode("ascii")))
        return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()
    except OverflowError as error:
        raise ValueError(str(error)) from None


def quoted(text: str) -> bytes:
    """Text as one word: what would end the word or the line is written as in an address."""
    return quote(text, safe="+-.:,TZ").encode("ascii")


def parse_json(raw: bytes) -> object:
    """The value of one line of JSON."""
    try:
        found: object = msgspec.json.decode(raw)
    except msgspec.DecodeError as error:
        raise ValueError(str(error)) from None
    return found
