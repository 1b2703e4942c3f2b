"""The almanac: the sky of many days in one file, which a separate process calculates and every gateway reads.

A day has a row every three hours for each part of the sky. Interpolation between the rows takes microseconds and is
within 0.004" of astropy's result (for the Moon; far less for the rest). A file is accepted if its header and checksum
are right and no other user can write it, because the Sun's position in it matters for safety. `SHIPPED_FILE` is an
almanac in the package, for rehearsals.
"""

from __future__ import annotations

import os
import stat
import struct
import zlib
from itertools import count
from operator import mul
from pathlib import Path

import msgspec

from gateway.core.errors import UserError, explain_os_error
from gateway.system.files import cache_folder, open_regular_fd
from gateway.system.runtime_folders import user_id

DAY, ROW_INTERVAL = 86400.0, 10800.0  # seconds
DAY_ROWS = 9  # from 0h to 24h inclusive: no row lies beyond a leap second at midnight
#: The range of dates that an almanac can cover, Unix time: from 1973-01-02, when the UT1 table begins, to 2099.
FIRST_DATE, LAST_DATE = 94780800.0, 4102444800.0
#: Parts of the sky. A row of ``frame`` (sidereal time, rotation from J2000 to date) has 10 numbers, that of a body 3.
SKY_PARTS = ("frame", "Sun", "Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
_FRAME_ROW, _BODY = struct.Struct("<10d"), struct.Struct("<3d")
#: For each part: the binary format of a row, and the offset of its first row in the bytes of a day.
_ROW_LAYOUTS = {
    body: (_BODY, DAY_ROWS * (_FRAME_ROW.size + number * _BODY.size)) for number, body in enumerate(SKY_PARTS[1:])
}
_ROW_LAYOUTS["frame"] = (_FRAME_ROW, 0)
_DAY_BYTES = DAY_ROWS * (_FRAME_ROW.size + len(SKY_PARTS[1:]) * _BODY.size)
#: The first bytes of a file: the name and version of the format.
FILE_HEADER = b"mount-gateway almanac 1\n"
#: The size limit of a file that is read (eight years); and how many days are stored: those added last.
MAX_FILE_BYTES, MAX_DAYS = 8_000_000, 200
SHIPPED_FILE = Path(__file__).with_name("rehearsal.almanac")

Row = tuple[float, ...]  # the values of one part of the sky at one time


class Almanac(msgspec.Struct, frozen=True):
    """Tables of the sky. ``days``: the encoded rows of all parts, by the number of the day since the Unix epoch."""

    days: dict[int, bytes] = {}

    def values_at(self, part: str, unix: float) -> Row | None:
        """Return the values of a part of the sky, by Lagrange interpolation in four rows; None without this day."""
        day = self.days.get(int(unix // DAY))
        if day is None:
            return None
        row_format, offset = _ROW_LAYOUTS[part]
        steps = unix % DAY / ROW_INTERVAL
        first = min(max(int(steps) - 1, 0), DAY_ROWS - 4)
        a = steps - first
        b, c, d = a - 1.0, a - 2.0, a - 3.0
        weights = (-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0)
        rows = [row_format.unpack_from(day, offset + number * row_format.size) for number in range(first, first + 4)]
        return tuple(sum(map(mul, weights, column)) for column in zip(*rows, strict=True))

    def count_days_from(self, first_day: int) -> int:
        """Return how many consecutive days from ``first_day`` on the almanac contains."""
        return next(number for number in count() if first_day + number not in self.days)

    def join(self, newer: Almanac) -> Almanac:
        """Return an almanac with the days of both; days that are in both are taken from ``newer``."""
        return Almanac({**self.days, **newer.days})

    def without_oldest_days(self) -> Almanac:
        """Return the almanac with at most `MAX_DAYS` days: those that were added last."""
        return Almanac(dict(list(self.days.items())[-MAX_DAYS:]))

    def encode(self) -> bytes:
        """Return the almanac as the content of a file."""
        content = msgspec.msgpack.encode(self)
        return FILE_HEADER + zlib.crc32(content).to_bytes(4, "little") + content


def decode(data: bytes) -> Almanac:
    """Return the almanac in the bytes of a file. Raises ValueError for another format or version, and for damage."""
    start = len(FILE_HEADER) + 4
    if not data.startswith(FILE_HEADER):
        raise ValueError("it is not an almanac of this version")
    if zlib.crc32(data[start:]) != int.from_bytes(data[len(FILE_HEADER) : start], "little"):
        raise ValueError("it is damaged")
    try:
        almanac = msgspec.msgpack.decode(data[start:], type=Almanac)
    except msgspec.MsgspecError as error:
        raise ValueError(f"it is not an almanac: {error}") from None
    if any(len(rows) != _DAY_BYTES for rows in almanac.days.values()):
        raise ValueError("a day in it is incomplete")
    return almanac


def read(path: Path) -> Almanac:
    """Read the almanac in a file. Raises OSError, and ValueError if it is invalid or other users can change it."""
    with open(open_regular_fd(path), "rb") as file:
        status = os.fstat(file.fileno())
        if user_id() is not None and status.st_uid not in (0, user_id()):
            raise ValueError("it belongs to another user, who can change it; make a copy of it, and name that")
        if user_id() is not None and stat.S_IMODE(status.st_mode) & 0o022:
            raise ValueError("other users can write it; chmod go-w, as its owner")
        return decode(file.read(MAX_FILE_BYTES))


def load_stored(path: str | None = None) -> Almanac:
    """Return the almanac of the cache folder (empty if it cannot be read), joined with that in the file ``path``.
    Raises UserError if the named file cannot be used.
    """
    try:
        almanac = read(cache_folder() / "almanac")
    except (OSError, ValueError):
        almanac = Almanac()
    try:
        return almanac if path is None else almanac.join(read(Path(path).expanduser()))
    except (OSError, ValueError) as error:
        raise UserError(
            f"--almanac {path}: {explain_os_error(error) if isinstance(error, OSError) else error}"
        ) from None
