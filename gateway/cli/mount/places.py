"""Where on the sky: two angles, or the name of an object.

``05:34:32 +22:00:52`` are hours and degrees, ``83.63 22.01`` degrees both. Angles are of date, as the mount itself and
``mount-gateway status`` tell them, unless they are said to be of 2000; a catalogue's places are of 2000.
"""

from __future__ import annotations

import argparse
import re

from gateway.app.control.commands import Spot, Where
from gateway.core.errors import UserError
from gateway.protocols.wireformat import sexagesimal

PLACES = """\
A place is RA DEC, of date as the mount tells it (--j2000: as catalogues and maps do), or the name of an object.
  05:34:32 +22:00:52     hours and degrees; 5h34m32s 22d00m52s, and fewer parts (05:34 22), are understood as well
  83.633 22.014          degrees both
  Moon  Mercury  Venus  Mars  Jupiter  Saturn  Uranus  Neptune
  Polaris  Vega  Sirius and about seventy other bright stars, by name
  M42  NGC7000  IC434  C14  UGC12914  HIP32349  "Ring Nebula"
                         from the object library, which is installed apart: docs/programs.md
"""


def add_place(command: argparse.ArgumentParser) -> None:
    """The arguments."""
    command.add_argument("place", nargs="+", metavar="PLACE", help="RA DEC, or the name of an object: see below")
    command.add_argument("--j2000", action="store_true", help="RA and DEC are of 2000, as catalogues have them")


def place(arguments: argparse.Namespace) -> Where:
    """What was typed. Raises UserError that says what would be right."""
    words = [word.strip() for word in arguments.place]
    if len(words) != 2 or not words[0][:1].isdecimal():
        from gateway.app.control import objects  # the catalogues: neither two angles nor another command needs them

        return objects.find(" ".join(words))
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
