"""Sexagesimal angles, clock times, dates and UTC offsets, to text and back. Angles are degrees.

Writing rounds the value once to whole units of the last digit ("ticks"), wraps it, and splits it into its parts. Angles
and times are read leniently: any separator that programs use, optional seconds, a fraction on the last part. Minutes
and seconds of exactly 60 carry, because programs round that way; more are refused. Every parser raises ValueError.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable
from functools import cache

from gateway.core.wire_log import printable

_SEPARATOR_PATTERN = rb"(?:\xc2\xb0|[\xdf\xb0*:' ])[ ]*"
_PARTS_PATTERN = (
    rb"[ ]*([+-]?)[ ]*(\d{1,3}(?:\.\d*)?)(?:"
    + _SEPARATOR_PATTERN
    + rb"(\d{1,2}(?:\.\d*)?)(?:"
    + _SEPARATOR_PATTERN
    + rb"(\d{1,2}(?:\.\d*)?))?)?[\"' ]*"
)


@cache
def _parts_matcher() -> re.Pattern[bytes]:
    """Return the compiled pattern of a sexagesimal value. It is compiled on first use, because that is slow."""
    return re.compile(_PARTS_PATTERN)


def parse(raw: bytes, min_parts: int = 2) -> float:
    """Parse ``sDD*MM:SS`` in any of its notations; return the signed number of degrees or hours. Raises ValueError,
    also for fewer than ``min_parts`` parts.
    """
    match = _parts_matcher().fullmatch(raw)
    if match is None:
        raise ValueError(f"'{printable(raw)}' is not a sexagesimal number")
    parts = [text for text in match.groups()[1:] if text is not None]
    if len(parts) < min_parts:
        raise ValueError(f"'{printable(raw)}' is incomplete")
    if any(b"." in text for text in parts[:-1]):
        raise ValueError(f"'{printable(raw)}' has a fraction before its last part")
    numbers = [float(text) for text in parts]
    if any(number > 60 for number in numbers[1:]):
        raise ValueError(f"'{printable(raw)}' has minutes or seconds over 60")
    value = 0.0
    for part in reversed(numbers):  # not sum(), whose last digit depends on the version of Python
        value = value / 60.0 + part
    return -value if match[1] == b"-" else value


def parse_typed_angle(text: str) -> float:
    """Parse a typed angle, with or without units: ``5h34m32s``, ``-22°00'52"``, ``83.63``. Raises ValueError."""
    return parse(re.sub(r"[hdms°'\"′″*:\s]+", ":", text.strip().lower()).rstrip(":").encode(), min_parts=1)


def require_unsigned(raw: bytes) -> bytes:
    """Return the text of an unsigned field unchanged. Raises ValueError if it has a sign."""
    if b"-" in raw or b"+" in raw:
        raise ValueError(f"'{printable(raw)}' has a sign, and this form has none")
    return raw


def require_whole(raw: bytes) -> bytes:
    """Return the text of a whole-number field unchanged. Raises ValueError if it has decimals."""
    if b"." in raw:
        raise ValueError(f"'{printable(raw)}' has decimals, and this form has none")
    return raw


def number(raw: bytes) -> float:
    """Parse a decimal number, which may have blanks around it. Raises ValueError."""
    if re.fullmatch(rb" *[+-]?(?:\d+\.?\d*|\.\d+) *", raw) is None:
        raise ValueError(f"'{printable(raw)}' is not a number")
    return float(raw)


def parse_hours(raw: bytes) -> float:
    """Parse a right ascension ``HH:MM:SS`` or ``HH:MM.T``; return degrees. 23:59:60 is 0."""
    value = parse(require_unsigned(raw))
    if value == 24 and raw.lstrip()[:2] == b"23":
        return 0.0
    return value * 15.0


def parse_azimuth(raw: bytes) -> float:
    """Parse an azimuth; return degrees in [0, 360): 360 becomes 0. Raises ValueError above 360."""
    value = parse(require_unsigned(raw))
    if value > 360:
        raise ValueError(f"'{printable(raw)}' is not an azimuth")
    return value % 360.0


def parse_longitude(raw: bytes) -> float:
    """Parse a Meade longitude, unsigned 0 to 360 or signed; return degrees in [-180, 180], west positive."""
    value = parse(raw)
    if not -180 <= value <= 360:
        raise ValueError(f"'{printable(raw)}' is not a longitude")
    return value - 360.0 if value > 180 else value


def parse_clock(raw: bytes) -> float:
    """Parse a time of day; return seconds since midnight. 23:59:60 is 86400, the midnight at the end of the day."""
    value = parse(require_unsigned(raw), min_parts=3)
    if value == 24 and raw.lstrip()[:2] != b"23":
        raise ValueError(f"'{printable(raw)}' is not a time of day")
    return value * 3600.0


def _split(ticks: int, *bases: int) -> list[int]:
    parts = []
    for base in reversed(bases):
        ticks, part = divmod(ticks, base)
        parts.append(part)
    return [ticks, *reversed(parts)]


def _ticks(value: float, per_unit: float) -> tuple[str, int]:
    ticks = round(abs(value) * per_unit)
    return ("-" if value < 0 and ticks else "+"), ticks


def _turn_writer(form: str, per_degree: int, *bases: int) -> Callable[[float], str]:
    """Return a function that writes degrees, wrapped to 0 to 360, in the format ``form``. ``per_degree``: ticks in a
    degree; ``bases``: the sizes of the parts after the first, such as 60 minutes and 60 seconds.
    """

    def written(degrees: float) -> str:
        return form.format(*_split(round(degrees * per_degree) % (360 * per_degree), *bases))

    return written


def _signed_writer(form: str, per_degree: int, *bases: int) -> Callable[[float], str]:
    """Return a function that writes a signed angle in the format ``form``. It raises ValueError beyond 90 degrees."""

    def written(degrees: float) -> str:
        sign, ticks = _ticks(degrees, per_degree)
        if ticks > 90 * per_degree:
            raise ValueError("an altitude, declination or latitude lies beyond 90 degrees")
        return sign + form.format(*_split(ticks, *bases))

    return written


#: Degrees -> ``HH:MM:SS``, ``HH:MM.T``, ``HH:MM:SS.SSSS``; ``DDD*MM:SS``, ``DDD*MM``; ``sDD*MM:SS``, ``sDD*MM``,
#: ``sDD*MM:SS.SSS``.
hours, hours_low = _turn_writer("{:02d}:{:02d}:{:02d}", 240, 60, 60), _turn_writer("{:02d}:{:02d}.{:d}", 40, 60, 10)
hours_fine = _turn_writer("{:02d}:{:02d}:{:02d}.{:04d}", 2400000, 60, 60, 10000)
azimuth, azimuth_low = _turn_writer("{:03d}*{:02d}:{:02d}", 3600, 60, 60), _turn_writer("{:03d}*{:02d}", 60, 60)
signed, signed_angle_low = _signed_writer("{:02d}*{:02d}:{:02d}", 3600, 60, 60), _signed_writer("{:02d}*{:02d}", 60, 60)
signed_angle_fine = _signed_writer("{:02d}*{:02d}:{:02d}.{:03d}", 3600000, 60, 60, 1000)


def longitude(degrees: float) -> str:
    """Write degrees, west positive, as ``sDDD*MM`` in (-180, 180]."""
    ticks = round(degrees * 60.0) % 21600
    ticks -= 21600 if ticks > 10800 else 0
    return ("-" if ticks < 0 else "+") + "{:03d}*{:02d}".format(*_split(abs(ticks), 60))


def clock(seconds: float) -> str:
    """Write seconds since midnight as ``HH:MM:SS``, rounded down as clocks show them."""
    return "{:02d}:{:02d}:{:02d}".format(*_split(int(seconds) % 86400, 60, 60))


def clock_12(seconds: float) -> str:
    """Write seconds since midnight as ``HH:MM:SS`` of a 12-hour clock (12, 1 … 11)."""
    hour, rest = divmod(int(seconds) % 86400, 3600)
    return clock(((hour + 11) % 12 + 1) * 3600 + rest)


def parse_limit(raw: bytes) -> float:
    """Parse an altitude limit; return degrees. Four digits are arcminutes. Raises ValueError beyond 90 degrees."""
    text = raw.rstrip(b"*'\xdf\xb0\xc2 ")
    value = number(text)
    value = value / 60.0 if re.fullmatch(rb" *\d{4} *", text) else value
    if not -90 <= value <= 90:
        raise ValueError(f"'{printable(raw)}' is not an altitude limit")
    return value


def parse_new_limit(raw: bytes) -> float:
    """Parse an altitude limit that a client sets: 0 to 90 whole degrees, without a sign. Raises ValueError."""
    return parse_limit(require_whole(require_unsigned(raw)))


def offset_in_full(value: float) -> str:
    """Write a UTC offset in hours as ``sHH.H``."""
    sign, tenths = _ticks(value, 10)
    return sign + "{:02d}.{:d}".format(*_split(tenths, 10))


def offset_with_minutes(value: float) -> str:
    """Write a UTC offset in hours as ``sHH:MM``."""
    sign, minutes = _ticks(value, 60)
    return sign + "{:02d}:{:02d}".format(*_split(minutes, 60))


def utc_offset(value: float) -> str:
    """Write a UTC offset in hours as ``sHH`` if whole, else as ``sHH.H``."""
    return offset_in_full(value).removesuffix(".0")


def parse_utc_offset(raw: bytes) -> float:
    """Parse a UTC offset ``sHH``, ``sHH.H``, ``s5`` or ``sHH:MM``; return hours. x.7 and x.8 are x.75 (Nepal)."""
    text = raw.replace(b" ", b"")
    value = parse(text, min_parts=1)
    if b":" not in text:
        whole, tenths = divmod(round(abs(value) * 10), 10)
        if tenths in (7, 8) and len(text.partition(b".")[2]) < 2:
            value = (whole + 0.75) * (-1 if text.startswith(b"-") else 1)
    if not -14 <= value <= 14:
        raise ValueError(f"'{printable(raw)}' is not a UTC offset")
    return value


def date(value: datetime.date) -> str:
    """Write a date as ``MM/DD/YY``."""
    return f"{value.month:02d}/{value.day:02d}/{value.year % 100:02d}"


def parse_date(raw: bytes) -> datetime.date:
    """Parse ``MM/DD/YY`` or ``MM/DD/YYYY``; : . - or space may replace /. Raises ValueError, also outside 1951-2050."""
    match = re.fullmatch(rb" ?(\d{1,2})[/:. -](\d{1,2})[/:. -](\d{2}|\d{4}) ?", raw)
    if match is None:
        raise ValueError(f"'{printable(raw)}' is not a date MM/DD/YY")
    month, day, year = (int(group) for group in match.groups())
    if len(match[3]) == 2:
        year += 2000 if year <= 50 else 1900
    if not 1951 <= year <= 2050:
        raise ValueError(f"'{printable(raw)}' is outside the years 1951 to 2050 that MM/DD/YY can express")
    try:
        return datetime.date(year, month, day)
    except ValueError:
        raise ValueError(f"'{printable(raw)}' is not a day of the calendar") from None


def dms_bytes(degrees: float) -> bytes:
    """Write degrees (north/east positive) as a NexStar site field: degrees, minutes, seconds, 1 for south or west."""
    sign, ticks = _ticks(degrees, 3600)
    return bytes((*_split(ticks, 60, 60), "+-".index(sign)))


def parse_dms_bytes(raw: bytes, limit: int) -> float:
    """Parse a NexStar site field; return degrees, north/east positive. Raises ValueError if it is out of range."""
    d, m, s, negative = raw
    value = d + m / 60.0 + s / 3600.0
    if m > 59 or s > 59 or negative > 1 or value > limit:
        raise ValueError(f"{d} {m} {s} {negative} is not a latitude or longitude (degrees, minutes, seconds, 0 or 1)")
    return -value if negative else value
