"""Where on the sky: two angles, or the name of an object.

``05:34:32 +22:00:52`` are hours and degrees, ``83.63 22.01`` degrees both. Angles are of date, as the mount itself and
``mount-gateway status`` tell them, unless they are said to be of 2000; a catalogue's places are of 2000.
"""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from gateway.app.control.commands import Body, Spot, Where
from gateway.core.errors import Fault, UserError
from gateway.protocols.wireformat import sexagesimal

if TYPE_CHECKING:
    from gateway.astro.catalog import Entry

PLACES = """\
A place is RA DEC, of date as the mount tells it (--j2000: as catalogues and maps do), or the name of an object.
  05:34:32 +22:00:52     hours and degrees; 5h34m32s 22d00m52s, and fewer parts (05:34 22), are understood as well
  83.633 22.014          degrees both
  M42  NGC7000  IC434  C14  UGC12914  HIP32349  Vega  "Rigel Kent"  "Ring Nebula"
                         from the object library (pip install 'mount-gateway[library]')
  Moon  Mercury  Venus  Mars  Jupiter  Saturn  Uranus  Neptune
"""
_RIGHT = "write RA DEC, like 05:34:32 +22:00:52, or a name, like M42, Vega or Jupiter"
BODIES = ("Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
_CATALOGUES = {"m": "M", "messier": "M", "ngc": "NGC", "ic": "IC", "c": "C", "caldwell": "C", "ugc": "UGC",
               "hip": "HIP"}  # fmt: skip
#: The highest number of the catalogues that have one of each.
_HIGHEST = {"M": 110, "NGC": 7840, "IC": 5386, "C": 109}
_YEAR = 365.25 * 86400.0


def add_place(command: argparse.ArgumentParser) -> None:
    """The arguments."""
    command.add_argument("place", nargs="+", metavar="PLACE", help="RA DEC, or the name of an object: see below")
    command.add_argument("--j2000", action="store_true", help="RA and DEC are of 2000, as catalogues have them")


def place(arguments: argparse.Namespace) -> Where:
    """What was typed. Raises UserError that says what would be right."""
    words = [word.strip() for word in arguments.place]
    text = " ".join(words)
    if named := next((body for body in BODIES if body.lower() == text.lower()), None):
        return Body(named)
    if text.lower().removeprefix("the ") == "sun":
        raise UserError("the Sun is no goal here: without a filter before the tube it blinds and burns")
    if found := re.fullmatch(r"([A-Za-z]+)[ -]*(\d{1,6})", text):
        return _numbered(found[1], int(found[2]))
    if len(words) != 2 or not words[0][:1].isdecimal():
        return _named(text)
    ra, dec = words
    degrees = ":" not in ra and "h" not in ra.lower()
    right = _angle(ra, "a right ascension", 360.0 if degrees else 24.0, 0.0)
    up = _angle(dec, "a declination", 90.0, -90.0)
    return Spot(right if degrees else right * 15.0, up, arguments.j2000)


def _angle(text: str, what: str, most: float, least: float) -> float:
    """Whole units and their fraction. Raises UserError."""
    plain = re.sub(r"[hdms°'\"′″*]", ":", text.lower()).rstrip(":")
    try:
        value = sexagesimal.parse(plain.encode(), least=1)
    except ValueError:
        raise UserError(f"{text!r} is not {what}: write it like 05:34:32, or in degrees like 83.63") from None
    if not least <= value <= most:
        raise UserError(f"{text!r} is not {what}: it is from {least:g} to {most:g}")
    return value


def _numbered(catalogue: str, number: int) -> Spot:
    """Raises UserError where it is not known."""
    from gateway.astro.catalog import deepsky, stars

    called = _CATALOGUES.get(catalogue.lower())
    if called is None:
        raise UserError(f"no catalogue is called {catalogue!r}; there are M, NGC, IC, C, UGC and HIP")
    name = f"{called}{number}"
    if called == "HIP":
        entry = _from_library(name, lambda: stars.hipparcos(number, _year()))
    else:
        entry = _from_library(name, lambda: deepsky.look_up(called, number))
    if entry is None:
        highest = _HIGHEST.get(called)
        goes = f"; {called} goes from 1 to {highest}" if highest else ""
        raise UserError(f"{name}: the library has no such object{goes}")
    return Spot(entry.ra, entry.dec, j2000=True)


def _named(text: str) -> Spot:
    """Raises UserError where it is not known."""
    from gateway.astro.catalog import names

    entry = _from_library(text, lambda: names.look_up(text, _year()))
    if entry is None:
        close = names.suggestions(text, BODIES)
        raise UserError(
            f"there is no object {text!r}; did you mean {' or '.join(close)}?"
            if close
            else f"{text!r} is no place: {_RIGHT}"
        )
    return Spot(entry.ra, entry.dec, j2000=True)


def _from_library(name: str, look: Callable[[], Entry | None]) -> Entry | None:
    """Raises UserError where the catalogue is not installed or cannot be read."""
    from gateway.astro.catalog.files import NotInstalled

    try:
        return look()
    except NotInstalled:
        raise UserError(
            f"{name}: the object library is not installed; pip install 'mount-gateway[library]' "
            "brings it, and RA DEC does without"
        ) from None
    except Fault as fault:
        raise UserError(f"{name}: {fault}") from None


def _year() -> float:
    return 1970.0 + time.time() / _YEAR
