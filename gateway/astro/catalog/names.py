"""Common names of objects: Vega, Rigel Kent, Ring Nebula; case, spaces, hyphens and other punctuation do not count.

The star names are this project's own list (``mappings/stars.toml``), each with a Hipparcos number. The stars of
alignment lists and charts have their positions there too, so that ``goto Polaris`` works without any catalogue. Names
of nebulae, clusters and galaxies are OpenNGC's. An unknown name gives None, and similar names are suggested.
"""

from __future__ import annotations

from gateway.astro.catalog import deepsky, stars
from gateway.astro.catalog.objects import Entry, NotInstalled
from gateway.core.errors import similar
from gateway.core.tables import read_table

_TABLE = read_table("stars.toml")
#: Name -> Hipparcos number.
HIPPARCOS: dict[str, int] = _TABLE["numbers"]
#: Other name or spelling -> name.
OTHER_NAMES: dict[str, str] = _TABLE["also"]
#: Name -> right ascension and declination, degrees, at the catalogue's epoch; proper motion, mas a year.
PLACES: dict[str, tuple[float, float, float, float]] = _TABLE["places"]
_BY_NUMBER = {HIPPARCOS[name]: place for name, place in PLACES.items()}
#: The similarity (0 to 1) from which a name is suggested, and how many are.
ALIKE, SUGGESTED = 0.72, 3


def by_number(number: int, year: float) -> tuple[float, float] | None:
    """Return the J2000 position in degrees of a star in ``PLACES`` in that year (2026.5); None for any other star."""
    place = _BY_NUMBER.get(number)
    return None if place is None else stars.with_proper_motion(*place, year)


def normalized(name: str) -> str:
    """Return a name without case, punctuation, spaces and a leading "the", for comparing spellings."""
    letters = "".join(letter for letter in name.casefold() if letter.isalnum())
    return letters.removeprefix("the")


_STARS = {normalized(name): HIPPARCOS[OTHER_NAMES.get(name, name)] for name in (*HIPPARCOS, *OTHER_NAMES)}


def star(name: str) -> int | None:
    return _STARS.get(normalized(name))


def look_up(name: str, year: float) -> Entry | None:
    """Return the star or deep sky object with this name, or None. Raises NotInstalled without the star catalogue."""
    number = star(name)
    if number is None:
        row = {normalized(known): row for known, row in _deep_sky().items()}.get(normalized(name))
        return None if row is None else deepsky.by_row(row)
    try:
        return stars.hipparcos(number, year)
    except NotInstalled:
        place = by_number(number, year)  # bright stars are known without the catalogue
        if place is None:
            raise
        return Entry(name, "*", *place)


def beginning(text: str, most: int) -> list[str]:
    """Return names that begin with a text: alignment stars first, other spellings last, shorter names before longer."""
    typed = normalized(text)
    spelled = {normalized(known): known for known in (*_deep_sky(), *OTHER_NAMES, *HIPPARCOS)}
    longer = [known for spelling, known in spelled.items() if typed and spelling.startswith(typed)]
    return sorted(longer, key=lambda known: (known in OTHER_NAMES, known not in PLACES, len(known)))[:most]


def suggestions(name: str, more: tuple[str, ...] = ()) -> list[str]:
    """Return known names that begin with an unknown one or are similar to it; ``more`` are additional known names."""
    spelled = {normalized(known): known for known in (*_deep_sky(), *OTHER_NAMES, *HIPPARCOS, *more)}
    typed = normalized(name)
    longer = sorted((known for known in spelled if len(typed) > 2 and known.startswith(typed)), key=len)
    close = [*longer, *similar(typed, spelled, SUGGESTED, ALIKE)]
    return [spelled[known] for known in dict.fromkeys(close)][:SUGGESTED]


def _deep_sky() -> dict[str, int]:
    """Return the common names of deep sky objects; none if the catalogue is not installed."""
    try:
        return deepsky.names()
    except NotInstalled:
        return {}
