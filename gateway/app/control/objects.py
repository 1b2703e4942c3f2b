"""Finds objects by the names that users type: M 42, NGC7000, HIP 91262, Vega, Ring Nebula, Jupiter.

The functions search catalogues on disk: do not call them on the thread of an event loop.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from typing import NamedTuple

from msgspec.structs import replace

from gateway.astro.catalog import deepsky, names, stars, supplied
from gateway.astro.catalog.objects import CatalogObject, NotInstalled
from gateway.core.errors import Fault, SunIsNoGoal, UserError
from gateway.core.requests import Body, ResolvedTarget, Spot
from gateway.system.own_commands import install_instruction

BODIES = ("Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
TARGET_SYNTAX = "write RA DEC, like 05:34:32 +22:00:52, or a name, like M42, Vega or Jupiter"
_CATALOGUES = {"m": "M", "messier": "M", "ngc": "NGC", "ic": "IC", "c": "C", "caldwell": "C", "ugc": "UGC",
               "hip": "HIP"}  # fmt: skip
#: The highest number of the catalogues that are numbered from 1 without gaps.
_MAX_NUMBER = {"M": 110, "NGC": 7840, "IC": 5386, "C": 109}
_KINDS = {"G": "galaxy", "P": "planetary nebula", "D": "diffuse nebula", "C": "globular cluster", "O": "open cluster",
          "DO": "cluster in a nebula", "*": "star"}  # fmt: skip
_YEAR_SECONDS = 365.25 * 86400.0


class SkyObject(NamedTuple):
    """An object: its name, position and kind (as text); its magnitude, length and width (arcminutes) if known."""

    name: str
    where: ResolvedTarget
    kind: str
    magnitude: float | None = None
    size: float | None = None
    width: float | None = None
    #: Its other names, separated by commas.
    also: str = ""
    #: How a double star looks in the eyepiece; empty for other objects.
    seen: str = ""


class LibraryMissing(UserError):
    """The object is in an object library that is not installed; ``remedy`` says how to install it."""

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason)
        self.remedy = remedy


def find_target(text: str) -> ResolvedTarget:
    """Return the position of an object; a planet or the Moon is returned as its name. Raises UserError."""
    return find_object(text).where


def find_object(text: str) -> SkyObject:
    """Return what is known of an object. Raises UserError that suggests what the user may have meant."""
    text = text.strip()
    if body := next((body for body in BODIES if body.lower() == text.lower()), None):
        return SkyObject(body, Body(body), "moon" if body == "Moon" else "planet")
    if text.lower().removeprefix("the ") == "sun":
        raise SunIsNoGoal(
            "no goto to the Sun: without a solar filter on the tube it blinds you and burns the optics. With a filter, "
            "start the gateway with --sun 0 and give coordinates: mount-gateway goto RA DEC"
        )
    if match := re.fullmatch(r"([A-Za-z]+)[ -]*(\d{1,6})", text):
        name, entry = _find_by_number(match[1], int(match[2]))
    else:
        name, entry = _find_by_name(text)
    star = int(match[2]) if match and match[1].lower() == "hip" else names.star_number(text)
    double = supplied.double_star_texts().get(star or 0, "")
    kind = "double star" if double or name == "M40" else _KINDS.get(entry.kinds, _KINDS.get(entry.kinds[:1], "object"))
    place = Spot(entry.ra, entry.dec, j2000=True)
    return SkyObject(name, place, kind, entry.magnitude, entry.size, entry.width, entry.also, double)


def completions(text: str, limit: int) -> list[str]:
    """Return up to ``limit`` names that begin with a text; else the text if it names a star, else similar names."""
    typed = supplied.normalized(text)
    bodies = [body for body in (*BODIES, "Sun") if typed and body.lower().startswith(typed)]
    begun = list(dict.fromkeys((*bodies, *_match_ids(text.strip()), *names.names_beginning_with(text, limit))))[:limit]
    return begun or ([text.strip()] if names.star_number(text) else names.suggestions(text, BODIES))


def _match_ids(text: str) -> list[str]:
    """Return catalogue numbers that begin with a text: all of Messier's, of larger catalogues only the typed number."""
    match = re.fullmatch(r"([A-Za-z]+)[ -]*(\d{1,6})", text)
    if match is None or not _id_exists(text):
        return []
    if _CATALOGUES[match[1].lower()] != "M":
        return [text.upper()]
    return [f"M {number}" for number in range(1, _MAX_NUMBER["M"] + 1) if str(number).startswith(str(int(match[2])))]


def _id_exists(text: str) -> bool:
    try:
        find_object(text)
    except UserError:
        return False
    return True


def _find_by_number(catalogue: str, number: int) -> tuple[str, CatalogObject]:
    called = _CATALOGUES.get(catalogue.lower())
    if called is None:
        raise UserError(f"no catalogue is called {catalogue!r}; there are M, NGC, IC, C, UGC and HIP")
    name = f"{called}{number}"
    if (highest := _MAX_NUMBER.get(called, number)) < number:
        raise UserError(f"there is no {name}: {called} goes from 1 to {called}{highest}")
    if (entry := supplied.look_up(name)) is not None:
        return name, replace(
            entry, also=", ".join(other for other in (entry.name, *entry.also.split(", ")) if other != name)
        )
    if called == "HIP" and number in supplied.stars():
        entry = names.entry_of_star(number, _year_now())
    elif called == "HIP":
        entry = _from_library(name, lambda: stars.hipparcos_star(number, _year_now()))
    else:
        entry = _from_library(name, lambda: deepsky.look_up(called, number))
    if entry is None:
        raise UserError(f"{name}: the library has no such object")
    return name, entry


def _find_by_name(text: str) -> tuple[str, CatalogObject]:
    entry = _from_library(text, lambda: names.look_up(text, _year_now()))
    if entry is None:
        close = names.suggestions(text, BODIES)
        raise UserError(
            f"there is no object {text!r}; did you mean {' or '.join(close)}?"
            if close
            else f"{text!r} is not a place: {TARGET_SYNTAX}"
        )
    return entry.name, entry


def _from_library(name: str, look_up: Callable[[], CatalogObject | None]) -> CatalogObject | None:
    try:
        return look_up()
    except NotInstalled:
        raise LibraryMissing(
            f"{name} is in the object library, which is not installed. Its RA and DEC work without it",
            install_instruction("library"),
        ) from None
    except Fault as fault:
        raise UserError(f"{name}: {fault}") from None


def _year_now() -> float:
    return 1970.0 + time.time() / _YEAR_SECONDS
