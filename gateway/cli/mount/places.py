"""Where on the sky: two angles, or the name of an object.

``05:34:32 +22:00:52`` are hours and degrees, ``83.63 22.01`` degrees both. Angles are of date, as the mount itself and
``mount-gateway status`` tell them, unless they are said to be of 2000; a catalogue's places are of 2000.
"""

from __future__ import annotations

import argparse
import re
import time
from difflib import get_close_matches

from gateway.app.control.commands import Body, Spot, Where
from gateway.astro.catalog import named_stars
from gateway.core.errors import Fault, UserError
from gateway.protocols.wireformat import sexagesimal
from gateway.system.own_commands import how_to_add

PLACES = """\
A place is RA DEC, of date as the mount tells it (--j2000: as catalogues and maps do), or the name of an object.
  05:34:32 +22:00:52     hours and degrees; 5h34m32s 22d00m52s, and fewer parts (05:34 22), are understood as well
  83.633 22.014          degrees both
  Moon  Mercury  Venus  Mars  Jupiter  Saturn  Uranus  Neptune
  Polaris  Vega  Sirius and about seventy other bright stars, by name
  M42  NGC7000  IC434  C14  UGC12914  HIP32349     from the object library, which is installed apart: docs/programs.md
"""
BODIES = ("Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
_CATALOGUES = {"m": "M", "messier": "M", "ngc": "NGC", "ic": "IC", "c": "C", "caldwell": "C", "ugc": "UGC",
               "hip": "HIP"}  # fmt: skip
_YEAR = 365.25 * 86400.0


def add_place(command: argparse.ArgumentParser) -> None:
    """The arguments."""
    command.add_argument("place", nargs="+", metavar="PLACE", help="RA DEC, or the name of an object: see below")
    command.add_argument("--j2000", action="store_true", help="RA and DEC are of 2000, as catalogues have them")


def place(arguments: argparse.Namespace) -> Where:
    """What was typed. Raises UserError that says what would be right."""
    words = [word.strip() for word in arguments.place]
    text = " ".join(words)
    if body := next((body for body in BODIES if body.lower() == text.lower()), None):
        return Body(body)
    if text.lower() == "sun":
        raise UserError("goto: the Sun is no goal here: without a filter before the tube it blinds and burns")
    if star := named_stars.find(text, _year()):
        return Spot(*star, j2000=True)
    if found := re.fullmatch(r"([A-Za-z]+) *(\d{1,6})", text):
        return _object(found[1], int(found[2]))
    if len(words) != 2 or not words[0][:1].isdecimal():
        raise _unknown(text)
    ra, dec = words
    degrees = ":" not in ra and "h" not in ra.lower()
    right = _angle(ra, "a right ascension", 360.0 if degrees else 24.0, 0.0)
    up = _angle(dec, "a declination", 90.0, -90.0)
    return Spot(right if degrees else right * 15.0, up, arguments.j2000)


def _unknown(text: str) -> UserError:
    """For what is neither two angles nor a name."""
    close = get_close_matches(text.title(), (*BODIES, *named_stars.STARS), 1, 0.75)
    right = (
        f"did you mean {close[0]}?"
        if close
        else ("write RA DEC, like 05:34:32 +22:00:52, or a name, like M42, Jupiter or Polaris")
    )
    return UserError(f"{text!r} is no place: {right}")


def _year() -> float:
    return 1970.0 + time.time() / _YEAR


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


def _object(catalogue: str, number: int) -> Spot:
    """Raises UserError where it is not known."""
    from gateway.astro.catalog import deepsky, stars
    from gateway.astro.catalog.files import NotInstalled

    called = _CATALOGUES.get(catalogue.lower())
    if called is None:
        raise UserError(f"no catalogue is called {catalogue!r}; there are M, NGC, IC, C, UGC and HIP")
    try:
        if called == "HIP":
            entry = stars.hipparcos(number, _year())
        else:
            entry = deepsky.look_up(called, number)
    except NotInstalled:
        raise UserError(
            f"{called}{number}: the object library is not installed; to install it, "
            f"{how_to_add('library')}. RA DEC and the names of planets and bright stars work "
            "without it"
        ) from None
    except Fault as fault:
        raise UserError(f"{called}{number}: {fault}") from None
    if entry is None:
        raise UserError(f"{called}{number}: the library has no such object")
    return Spot(entry.ra, entry.dec, j2000=True)
