"""The objects that every installation has, without any package: the files of ``mappings/sky/``.

They contain a part of OpenNGC (2,800 nebulae, clusters and galaxies), the stars with a Bayer letter, a Flamsteed
number or a name, and sixty double stars; a script in ``docs/tools`` writes them. Each file is read when it is
first needed. Spellings are compared without case, spaces and punctuation (``normalized``).
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from gateway.astro.catalog.objects import CatalogObject
from gateway.astro.catalog.stars import with_proper_motion
from gateway.core.tables import mappings_folder

#: The files that the console's page reads too.
PAGE_FILES = ("deepsky.json", "doubles.json", "LICENSE-CC-BY-SA-4.0.txt")
_GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "epsilon", "ζ": "zeta", "η": "eta", "θ": "theta",
    "ι": "iota", "κ": "kappa", "λ": "lambda", "μ": "mu", "ν": "nu", "ξ": "xi", "ο": "omicron", "π": "pi", "ρ": "rho",
    "σ": "sigma", "τ": "tau", "υ": "upsilon", "φ": "phi", "χ": "chi", "ψ": "psi", "ω": "omega",
}  # fmt: skip
#: Last words of names; users may omit them if no other object has the rest: Lagoon finds the Lagoon Nebula.
_KIND_SUFFIXES = ("nebula", "galaxy", "starcluster", "cluster")
#: Every spelling of a Greek letter -> the letter: alpha, alf, alp and the letter itself.
_SPELLINGS = {spelled: letter for letter, name in _GREEK.items() for spelled in (name, name[:3], letter)} | {"alf": "α"}


class Star(msgspec.Struct, array_like=True, frozen=True):
    """A Hipparcos star: its position in 1991.25 (degrees), its proper motion to the east and north (mas a year); its
    Bayer and Flamsteed designations are separated by ``|``.
    """

    number: int
    designations: str
    ra: float
    dec: float
    pm_east: float
    pm_north: float
    magnitude: float

    def position_at(self, year: float) -> tuple[float, float]:
        """Return the J2000 position with proper motion up to a year (as 2026.5), degrees."""
        return with_proper_motion(self.ra, self.dec, self.pm_east, self.pm_north, year)


def normalized(name: str) -> str:
    """Return a name without case, punctuation, spaces and a leading "the", for comparing spellings."""
    letters = "".join(letter for letter in name.casefold() if letter.isalnum())
    return letters.removeprefix("the") if name.casefold().startswith("the ") else letters


def sky_file(file_name: str) -> Path:
    return mappings_folder() / "sky" / file_name


def _read_json(file_name: str) -> dict[str, Any]:
    content: dict[str, Any] = msgspec.json.decode(sky_file(file_name).read_bytes())
    return content


@cache
def deep_sky() -> dict[str, CatalogObject]:
    """Return nebulae, clusters and galaxies by each of their catalogue numbers and names, spelled as in the file."""
    rows: list[Any] = _read_json("deepsky.json")["rows"]
    objects: dict[str, CatalogObject] = {}
    for names, *row in reversed(rows):  # a name that several objects have means the first of them
        first, *others = names.split("|")
        objects |= dict.fromkeys((first, *others), CatalogObject(*(first, *row, ", ".join(others))))
    return objects


@cache
def _object_by_spelling() -> dict[str, CatalogObject]:
    """Return the objects of ``deep_sky`` by normalized name, also without kind suffix if only one object has that."""
    spelled = {normalized(name): entry for name, entry in deep_sky().items()}
    shorter: dict[str, set[str]] = {}
    for name in spelled:
        if (short := without_kind_suffix(name)) not in spelled:
            shorter.setdefault(short, set()).add(name)
    return spelled | {short: spelled[names.pop()] for short, names in shorter.items() if len(names) == 1}


def without_kind_suffix(name: str) -> str:
    """Return a normalized name without a last word like "nebula"."""
    return next((name.removesuffix(ending) for ending in _KIND_SUFFIXES if name.endswith(ending)), name)


def look_up(name: str) -> CatalogObject | None:
    """Return a nebula, cluster or galaxy by a number (NGC7000) or a name (North America), or None."""
    return _object_by_spelling().get(normalized(name))


@cache
def stars() -> dict[int, Star]:
    """Return the stars by their Hipparcos numbers."""
    return {star.number: star for star in msgspec.convert(_read_json("stars.json")["rows"], list[Star])}


@cache
def _letter_tables() -> tuple[dict[str, int], dict[str, str]]:
    """Return Hipparcos numbers by designation (``αOri``, ``61Cyg``), and constellations' abbreviations by spelling.

    A letter that several stars share means the well-known double (ε1 Lyr), or else the brightest star.
    """
    numbers: dict[str, int] = {}
    for star in sorted(stars().values(), key=lambda star: (star.number not in double_star_texts(), star.magnitude)):
        for name in filter(None, star.designations.split("|")):
            letter, constellation = name.split(" ")
            numbers.setdefault(letter + constellation, star.number)
            if not letter.isdecimal():
                numbers.setdefault(letter[0] + constellation, star.number)
    names: dict[str, list[str]] = _read_json("stars.json")["constellations"]
    spelled = {normalized(spelling): short for short, both in names.items() for spelling in (short, *both)}
    return numbers, spelled


def star_number_by_letter(name: str) -> int | None:
    """Return the Hipparcos number of a star by Bayer letter or Flamsteed number: alpha Ori, 61 Cygni; or None."""
    typed = normalized(name)
    parts = re.fullmatch(r"(\d+)()(\D+)", typed)
    if parts is not None:
        letter = parts[1]
    elif begins := [letter for letter in _SPELLINGS if typed.startswith(letter)]:
        longest = max(begins, key=len)
        parts = re.fullmatch(r"()(\d*)(\D+)", typed.removeprefix(longest))
        letter = _SPELLINGS[longest]
    if parts is None:
        return None
    numbers, constellations = _letter_tables()
    return numbers.get(f"{letter}{parts[2]}{constellations.get(parts[3])}")


@cache
def double_star_texts() -> dict[int, str]:
    """Return texts with the magnitudes and separation of the double stars, by Hipparcos number."""
    return {
        row[1]: f"magnitudes {row[4]:.1f} and {row[5]:.1f}, {row[6]:g}″ apart: {row[7]}"
        for row in _read_json("doubles.json")["rows"]
    }


@cache
def double_numbers_by_name() -> dict[str, int]:
    """Return the Hipparcos numbers of the double stars by their names: Double Double, Albireo."""
    return {row[0].split("|")[0]: row[1] for row in _read_json("doubles.json")["rows"]}
