"""Common names of objects: Vega, alpha Lyr, 61 Cygni, Rigel Kent, Ring Nebula; spaces and punctuation do not count.

The names of stars are this project's own list (``mappings/stars.toml``), each with a Hipparcos number. Bayer letters,
and the names of nebulae, clusters and galaxies, come from ``supplied.py``, which works in every installation. For an
unknown name the result is None; similar names can be suggested.
"""

from __future__ import annotations

from functools import cache

from gateway.astro.catalog import supplied
from gateway.astro.catalog.objects import CatalogObject
from gateway.astro.catalog.supplied import normalized
from gateway.core.errors import similar_words
from gateway.core.tables import read_table

_STAR_TABLE = read_table("stars.toml")
#: Name -> Hipparcos number.
HIP_IDS: dict[str, int] = _STAR_TABLE["numbers"]
#: Other name or spelling -> name.
OTHER_NAMES: dict[str, str] = _STAR_TABLE["also"]
#: The least similarity (0 to 1) of a suggested name, and the greatest number of suggestions.
MIN_SIMILARITY, MAX_SUGGESTIONS = 0.72, 3
#: The magnitude by which objects without a magnitude are sorted: after all others.
_NO_MAGNITUDE = 99.0

_NUMBER_BY_SPELLING = {normalized(name): HIP_IDS[OTHER_NAMES.get(name, name)] for name in (*HIP_IDS, *OTHER_NAMES)}


def star_number(name: str) -> int | None:
    """Return the Hipparcos number of a star by its name, Bayer letter or Flamsteed number; None if it is unknown."""
    doubles = {normalized(known): number for known, number in supplied.double_numbers_by_name().items()}
    return (_NUMBER_BY_SPELLING | doubles).get(normalized(name)) or supplied.star_number_by_letter(name)


def look_up(name: str, year: float) -> CatalogObject | None:
    """Return the star or deep sky object of this name, or None. ``year``: epoch of proper motion (position: J2000)."""
    number = star_number(name)
    return supplied.look_up(name) if number is None else entry_of_star(number, year)


def entry_of_star(number: int, year: float) -> CatalogObject:
    """Return the entry of a star, with proper motion up to ``year``. ``supplied.stars`` must contain the number."""
    known = supplied.stars()[number]
    called = next((name for name, hip_id in HIP_IDS.items() if hip_id == number), "")
    first, *others = filter(None, (called, *known.designations.split("|")))
    return CatalogObject(first, "*", *known.position_at(year), known.magnitude, also=", ".join(others))


def names_beginning_with(text: str, max_count: int) -> list[str]:
    """Return names that begin with a text, then names with a word that does; in each part the brightest stars first."""
    typed = normalized(text)
    if not typed:
        return []
    spelled = _name_by_spelling()
    begin = [known for spelling, known in spelled.items() if spelling.startswith(typed)]
    containing = [
        known for known in spelled.values() if any(normalized(word).startswith(typed) for word in known.split())
    ]
    return list(dict.fromkeys((*sorted(begin, key=_sort_key), *sorted(containing, key=_sort_key))))[:max_count]


def _sort_key(name: str) -> tuple[bool, float, int]:
    number = HIP_IDS.get(name)
    return name in OTHER_NAMES, _NO_MAGNITUDE if number is None else supplied.stars()[number].magnitude, len(name)


def suggestions(name: str, more_names: tuple[str, ...] = ()) -> list[str]:
    """Return up to three names of the catalogues, or of ``more_names``, that begin with or resemble an unknown name."""
    spelled = _name_by_spelling() | {normalized(known): known for known in more_names}
    spelled = {supplied.without_kind_suffix(spelling): known for spelling, known in spelled.items()} | spelled
    typed = normalized(name)
    longer = sorted((known for known in spelled if len(typed) > 2 and known.startswith(typed)), key=len)
    close = [*longer, *similar_words(typed, spelled, 2 * MAX_SUGGESTIONS, MIN_SIMILARITY)]
    known = dict.fromkeys(spelled[spelling] for spelling in close)
    return [other for other in known if OTHER_NAMES.get(other) not in known][:MAX_SUGGESTIONS]


@cache
def _name_by_spelling() -> dict[str, str]:
    """Return the names by normalized spelling, without catalogue numbers; stars win if two are spelled alike."""
    names = [name for name in supplied.deep_sky() if not name[-1].isdecimal() or " " in name]
    return {normalized(name): name for name in (*names, *supplied.double_numbers_by_name(), *OTHER_NAMES, *HIP_IDS)}
