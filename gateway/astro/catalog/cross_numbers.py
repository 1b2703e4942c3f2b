"""Stars by their numbers in the catalogues SAO, HD and HR: by way of the Hipparcos number of the same star.

Which number is which star no package of the extra ``library`` says. Stellarium's list does, and the package fchart3
brings it; both are under the GPL, so it is no part of this program, and is read where somebody has installed it. It
knows 101,000 stars of SAO, 99,000 of HD, and all of HR's that Hipparcos has seen.
"""

from __future__ import annotations

import re

from msgspec.structs import replace

from gateway.astro.catalog import stars
from gateway.astro.catalog.files import NotInstalled, data_file
from gateway.astro.catalog.objects import Entry

PACKAGE = "fchart3"
#: The columns between the Hipparcos number, with the letter of a component behind it, and each catalogue's own.
COLUMNS = {"SAO": 0, "HD": 1, "HR": 2}


class NoCrossNumbers(NotInstalled):
    """The list of the stars' other numbers is missing."""

    words = "Star catalog not installed."


def hipparcos_number(catalogue: str, number: int) -> int | None:
    """Of a pair that shares a number, the first star's. Raises NoCrossNumbers."""
    try:
        data = data_file(PACKAGE, "data/catalogs/cross-id.dat").read_bytes()
    except NotInstalled:
        raise NoCrossNumbers from None
    before = rb"[^\t\n]*\t" * (COLUMNS[catalogue] + 1)
    found = re.search(rb"^(\d+)\t" + before + str(number).encode() + rb"\s", data, re.MULTILINE)
    return None if found is None else int(found[1])


def look_up(catalogue: str, number: int, year: float) -> Entry | None:
    """The star where it stands in that year, J2000. Raises NotInstalled."""
    hipparcos = hipparcos_number(catalogue, number)
    entry = None if hipparcos is None else stars.hipparcos(hipparcos, year)
    return None if entry is None else replace(entry, name=f"{catalogue}{number}")
