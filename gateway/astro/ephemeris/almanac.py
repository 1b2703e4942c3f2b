"""The almanac: the day tables of many days in one file, which a process of its own calculates and every gateway reads.

The file also holds the sites that users wrote with minutes or letters, in decimals, and says which astropy and which
IERS data it is from. Its name of the format, a checksum, and whose it is decide whether it is used: never if another
user can write it, because it says where the Sun is. `SHIPPED`, in the package, is one for the days of the rehearsals.
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from collections.abc import Iterable
from itertools import count
from pathlib import Path

import msgspec

from gateway.astro.ephemeris.day_table import PARTS, ROWS, DayTable
from gateway.system.files import plain_file
from gateway.system.runtime_folders import user

#: Names the format and its version.
MAGIC = b"mount-gateway almanac 1\n"
#: The longest file that is read: eight years.
LONGEST = 8_000_000
#: The days of the rehearsals; tests make and check it.
SHIPPED = Path(__file__).with_name("rehearsal.almanac")
_ROWS = {part: struct.Struct("<10d" if part == "frame" else "<3d") for part in PARTS}
_DAY = ROWS * sum(row.size for row in _ROWS.values())


class Almanac(msgspec.Struct, frozen=True):
    """``days`` holds the rows of each day since the Unix epoch, part after part; ``by`` names astropy and the data."""

    by: str = ""
    days: dict[int, bytes] = {}
    sites: dict[str, tuple[float, float]] = {}

    def table(self, part: str, day: int) -> DayTable | None:
        """Return the table of a part of the sky for a day; None if the day is not in the almanac."""
        rows = self.days.get(day)
        if rows is None:
            return None
        row = _ROWS[part]
        before = ROWS * sum(_ROWS[other].size for other in PARTS[: PARTS.index(part)])
        return DayTable([*row.iter_unpack(rows[before : before + ROWS * row.size])])

    def days_from(self, first: int) -> int:
        """Return how many days it has from this one on, until the first that it has not."""
        return next(number for number in count() if first + number not in self.days)

    def joined(self, newer: Almanac) -> Almanac:
        """Return this almanac with what a newer one has, and without days of another astropy or of other data."""
        days = self.days if self.by == newer.by else {}
        return Almanac(newer.by, {**days, **newer.days}, {**self.sites, **newer.sites})

    def only(self, first: int, last: int, others: int) -> Almanac:
        """Return it with the days from ``first`` to ``last``, and the newest of all other days and of the sites."""
        newest = list(self.days)[-others:]
        kept = {day: rows for day, rows in self.days.items() if first <= day <= last or day in newest}
        return Almanac(self.by, kept, dict(list(self.sites.items())[-others:]))

    def encoded(self) -> bytes:
        """Return the content of a file."""
        content = msgspec.msgpack.encode(self)
        return MAGIC + zlib.crc32(content).to_bytes(4, "little") + content


def rows_of(tables: Iterable[Iterable[Iterable[float]]]) -> bytes:
    """Return the rows of a day from those of its parts, in the order of ``PARTS``."""
    return b"".join(_ROWS[part].pack(*row) for part, rows in zip(PARTS, tables, strict=True) for row in rows)


def decoded(data: bytes) -> Almanac:
    """Return the almanac of a file. Raises ValueError if it is none, is of another version, or is damaged."""
    start = len(MAGIC) + 4
    if not data.startswith(MAGIC):
        raise ValueError("it is no almanac of this version")
    if zlib.crc32(data[start:]) != int.from_bytes(data[len(MAGIC) : start], "little"):
        raise ValueError("it is damaged")
    try:
        almanac = msgspec.msgpack.decode(data[start:], type=Almanac)
    except msgspec.MsgspecError as error:
        raise ValueError(f"it is no almanac: {error}") from None
    if any(len(rows) != _DAY for rows in almanac.days.values()):
        raise ValueError("its days are not whole")
    return almanac


def read(path: Path) -> Almanac:
    """Return the almanac of a file. Raises OSError, and ValueError if it cannot be used or trusted."""
    number = plain_file(path)
    with open(number, "rb") as file:
        seen = os.fstat(number)
        if user() is not None and seen.st_uid not in (0, user()):
            raise ValueError("it belongs to another user, who can change it; make a copy of it, and name that")
        if user() is not None and stat.S_IMODE(seen.st_mode) & 0o022:
            raise ValueError("other users can write it; chmod go-w, as its owner")
        return decoded(file.read(LONGEST))
