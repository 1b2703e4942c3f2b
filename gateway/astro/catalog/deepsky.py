"""Messier, NGC, IC, Caldwell and UGC objects from OpenNGC, the database in the package pyongc.

It is read with sqlite3, not with the package's own functions: those return single objects with numpy arrays and
take seconds for a search by limits. Only objects with an NGC or IC number can be found by a UGC number.

A search covers the sky in strips of an hour of right ascension from north to south, the westernmost strip first,
because its objects set first. It skips objects that the mount may not go to.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import lru_cache
from pathlib import Path
from typing import Any

from gateway.astro.catalog.objects import MAG_LIMITS, QUALITIES, CatalogObject, SearchLimits, data_file, quality
from gateway.astro.spherical import separation, wrap360

#: The kind letters (see ``objects``) of each OpenNGC type; nonexistent objects have none.
_KIND_LETTERS = {
    "G": "G", "GPair": "G", "GTrpl": "G", "GGroup": "G", "PN": "P", "Neb": "D", "HII": "D", "EmN": "D", "RfN": "D",
    "SNR": "D", "DrkN": "D", "Cl+N": "DO", "GCl": "C", "OCl": "O", "*Ass": "O", "*": "*", "**": "*", "Nova": "*",
}  # fmt: skip
#: The magnitude that a search assumes for an unmeasured object: it is only found with the faintest possible limit.
_UNMEASURED_MAGNITUDE = 20.0
_OBJECT_COLUMNS = "name, type, ra, dec, coalesce(vmag, bmag), majax, minax, messier"
#: Columns of a candidate; the database stores angles in radians.
_CANDIDATE_COLUMNS = f"id, ra * {math.degrees(1.0)!r} AS right, dec * {math.degrees(1.0)!r} AS up"
_IDENTIFIER_FORMATS = {"NGC": "NGC%04d", "IC": "IC%04d", "C": "C%03d", "UGC": "UGC%05d"}
#: OpenNGC regards M102 as a duplicate of M101; hand controls, also Meade's, go to NGC 5866 in Draco.
_REPLACED_MESSIER = {102: ("NGC", 5866)}


#: An object in a search: database row, right ascension, declination. A plain tuple, because there are twelve thousand.
Candidate = tuple[int, float, float]
#: Whether the mount may go to a J2000 position (degrees) now: an object there is then called visible.
Visible = Callable[[float, float], bool]
_BEYOND_LAST_ROW = 1 << 60  # greater than the number of every database row


def look_up(catalog: str, number: int) -> CatalogObject | None:
    """Return the object of ``M``, ``NGC``, ``IC``, ``C`` or ``UGC`` with this number, or None. Raises NotInstalled."""
    called = f"{catalog}{number}"
    if catalog == "M":
        catalog, number = _REPLACED_MESSIER.get(number, (catalog, number))
    if catalog == "M":
        rows = _select("messier = ? AND type != 'Dup' OR name = ?", f"{number:03d}", f"M{number:03d}")
    else:
        name = _IDENTIFIER_FORMATS[catalog] % number
        rows = _select("name = (SELECT name FROM objIdentifiers WHERE identifier = ?)", name)
    if not rows:
        return None
    row = rows[0]
    if row[1] == "Dup":
        row = _original_of_duplicate(row[0]) or row
    return None if row[2] is None else _object_from_row(row, called)


def object_by_row(row_id: int) -> CatalogObject:
    """Return the object of a database row. Raises NotInstalled."""
    return _object_from_row(_select("id = ?", row_id)[0])


def _original_of_duplicate(name: str) -> tuple[object, ...] | None:
    """Return the row of the object that a duplicate record refers to; None if the catalogue does not contain it."""
    numbers = _select("name = ?", name, columns="ngc, ic, messier")[0]
    for template, number in zip(("NGC{}", "IC{}"), numbers, strict=False):
        if number:
            return next(iter(_select("name = ?", template.format(number))), None)
    return next(iter(_select("messier = ? AND type != 'Dup'", numbers[2])), None)


def _object_from_row(row: tuple[Any, ...], name: str | None = None) -> CatalogObject:
    identifier, kind, ra, dec, magnitude, size, width, messier = row
    catalog, number = (
        identifier[: len(identifier) - len(identifier.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ"))],
        identifier.lstrip("NGCI"),
    )
    shown = f"M{int(messier)}" if messier else (f"{catalog}{int(number)}" if number.isdigit() else identifier)
    return CatalogObject(
        name or shown, _KIND_LETTERS.get(kind, "?"), math.degrees(ra), math.degrees(dec), magnitude, size, width
    )


def _select(where: str, *values: Any, columns: str = _OBJECT_COLUMNS) -> list[tuple[Any, ...]]:
    """Return the rows of the database table ``objects`` that fulfil an SQL condition with these parameters."""
    import sqlite3  # takes 10 ms, and most gateways never need it

    path = data_file("pyongc", "ongc.db")
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as database:
        return database.execute(f"SELECT {columns} FROM objects WHERE {where}", values).fetchall()


# --- searching --------------------------------------------------------------------------------------------------------


def find_matches(limits: SearchLimits) -> list[Candidate]:
    """Return the objects within limits, in ``search_order``, in a cached list: do not alter it. Raises NotInstalled."""
    return _find_matches(data_file("pyongc", "ongc.db"), limits)


@lru_cache(maxsize=2)
def _find_matches(_: Path, limits: SearchLimits) -> list[Candidate]:
    types = [name for name, kinds in _KIND_LETTERS.items() if set(kinds) & set(limits.kinds)]
    least = QUALITIES.index(limits.quality)
    faintest = min(limits.max_mag, MAG_LIMITS[least]) if least < len(MAG_LIMITS) else limits.max_mag
    more_columns = ", coalesce(vmag, bmag), majax, minax" if least < len(MAG_LIMITS) else ""
    rows = _select(
        f"type IN ({', '.join('?' * len(types))}) AND ra IS NOT NULL "
        f"AND coalesce(vmag, bmag, {_UNMEASURED_MAGNITUDE}) BETWEEN ? AND ? AND coalesce(majax, 0) BETWEEN ? AND ? "
        "ORDER BY CAST(right / 15.0 AS INTEGER), up DESC, id",
        *types, limits.min_mag, faintest, limits.min_size, limits.max_size, columns=_CANDIDATE_COLUMNS + more_columns,
    )  # fmt: skip
    if more_columns:
        rows = [row[:3] for row in rows if QUALITIES.index(quality(*row[3:])) <= least]
    return rows


def search_order(candidate: Candidate) -> tuple[int, float, int]:
    """Return the sort key of a candidate: by whole hours of right ascension, then from north to south."""
    row, ra, dec = candidate
    return int(ra / 15.0), -dec, row


def first_visible(candidates: Sequence[Candidate], is_visible: Visible, meridian_ra: float) -> Candidate | None:
    """Return the first visible candidate from the westernmost strip on; ``meridian_ra``: sidereal time, degrees."""
    first_key = int(wrap360(meridian_ra + 180.0) / 15.0), -90.0, 0
    return _next_visible(candidates, bisect_left(candidates, first_key, key=search_order), 1, is_visible)


def neighbour(
    candidates: Sequence[Candidate], is_visible: Visible, ra: float, dec: float, step: int
) -> Candidate | None:
    """Return the next visible candidate after a J2000 position in degrees (``step`` 1) or before it (-1), or None."""
    after = bisect_left(candidates, search_order((_BEYOND_LAST_ROW, ra, dec)), key=search_order)
    before = bisect_left(candidates, search_order((0, ra, dec)), key=search_order) - 1
    return _next_visible(candidates, after if step > 0 else before, step, is_visible)


def _next_visible(candidates: Sequence[Candidate], start: int, step: int, is_visible: Visible) -> Candidate | None:
    """Return the first visible candidate from index ``start`` on (``step`` 1) or back (-1), once around the sky."""
    count = len(candidates)
    for offset in range(count):
        candidate = candidates[(start + step * offset) % count]
        if is_visible(*candidate[1:]):
            return candidate
    return None


def candidates_in_field(candidates: Sequence[Candidate], ra: float, dec: float, radius: float) -> list[Candidate]:
    """Return the candidates within ``radius`` degrees of a J2000 position, the nearest first."""
    near = [(separation(ra, dec, c[1], c[2]), c) for c in candidates if abs(c[2] - dec) <= radius]
    return [candidate for distance, candidate in sorted(near) if distance <= radius]
