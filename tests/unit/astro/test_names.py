"""Stars and deep sky objects by name. Places are typed from general knowledge, and compared with the catalogue's."""

from __future__ import annotations

import math
from typing import Any

import pytest

from gateway.app.control import objects
from gateway.astro.catalog import names, stars
from gateway.astro.catalog.names import HIP_IDS, OTHER_NAMES
from gateway.astro.catalog.objects import NotInstalled
from gateway.astro.spherical import separation
from gateway.cli.completion import completion_script
from gateway.cli.mount.requests import typed_target
from gateway.core.errors import UserError
from gateway.core.requests import Spot
from tests.support.each import each

#: name, J2000 hours, minutes, degrees, minutes
PLACES = [
    ("Achernar", 1, 37.7, -57, 14), ("Albireo", 19, 30.7, 27, 58), ("Aldebaran", 4, 35.9, 16, 31),
    ("Algol", 3, 8.2, 40, 57), ("Altair", 19, 50.8, 8, 52), ("Antares", 16, 29.4, -26, 26),
    ("Arcturus", 14, 15.7, 19, 11), ("Betelgeuse", 5, 55.2, 7, 24), ("Canopus", 6, 24.0, -52, 42),
    ("Capella", 5, 16.7, 46, 0), ("Castor", 7, 34.6, 31, 53), ("Deneb", 20, 41.4, 45, 17),
    ("Dubhe", 11, 3.7, 61, 45), ("Fomalhaut", 22, 57.7, -29, 37), ("Mizar", 13, 23.9, 54, 56),
    ("Polaris", 2, 31.8, 89, 16), ("Pollux", 7, 45.3, 28, 2), ("Procyon", 7, 39.3, 5, 14),
    ("Regulus", 10, 8.4, 11, 58), ("Rigel", 5, 14.5, -8, 12), ("Rigil Kentaurus", 14, 39.6, -60, 50),
    ("Sirius", 6, 45.1, -16, 43), ("Spica", 13, 25.2, -11, 10), ("Vega", 18, 36.9, 38, 47),
]  # fmt: skip
#: Where these lists use a name for another star than the International Astronomical Union does.
OTHERWISE = {"Algenib", "Gienah", "Markab", "Toliman"}


class Typed:
    """What was typed as a place."""

    j2000 = False

    def __init__(self, *words: str) -> None:
        self.place = list(words)


def spot(*words: str) -> Spot:
    found = typed_target(Typed(*words))  # type: ignore[arg-type]
    assert isinstance(found, Spot)
    return found


@each(("name", "hours", "minutes", "degrees", "arcminutes"), PLACES)
def test_object_name_gives_its_position(name: str, hours: int, minutes: float, degrees: int, arcminutes: int) -> None:
    found = spot(*name.split())
    assert found.j2000
    dec = math.copysign(abs(degrees) + arcminutes / 60.0, degrees)
    assert separation(found.ra, found.dec, 15.0 * (hours + minutes / 60.0), dec) < 0.03


def test_every_star_name_is_a_star_of_the_catalogue() -> None:
    entries = {name: stars.hipparcos_star(number, 2000.0) for name, number in HIP_IDS.items()}
    assert len(entries) >= 150
    for name, entry in entries.items():
        assert entry is not None and entry.magnitude is not None, name
        assert entry.magnitude < 5.5 or name in ("Barnard's Star", "Proxima Centauri"), name
    assert set(OTHER_NAMES.values()) <= set(HIP_IDS) and not set(OTHER_NAMES) & set(HIP_IDS)
    for name in (*HIP_IDS, *OTHER_NAMES):  # no two of them are spelled alike
        assert names.star_number(name) == HIP_IDS[OTHER_NAMES.get(name, name)], name


def test_star_names_mean_the_same_as_in_other_lists() -> None:
    """Two lists that were made by others."""
    from ephem.stars import stars as ephems
    from skyfield.named_stars import named_star_dict as skyfields

    meant = {name: HIP_IDS[OTHER_NAMES.get(name, name)] for name in (*HIP_IDS, *OTHER_NAMES)}
    compared = [name for name in meant if name in skyfields and name not in OTHERWISE]
    assert len(compared) > 90
    assert {name: meant[name] for name in compared} == {name: skyfields[name] for name in compared}
    checked = 0
    for name in HIP_IDS:
        if (body := ephems.get(name)) is not None:
            entry = stars.hipparcos_star(HIP_IDS[name], 2000.0)
            assert entry is not None
            where: tuple[Any, Any] = body._ra, body._dec
            assert separation(entry.ra, entry.dec, *(math.degrees(angle) for angle in where)) < 0.02, name
            checked += 1
    assert checked > 90


@each(("typed", "same"), [
    (("vega",), ("HIP91262",)), (("VEGA",), ("HIP", "91262")), (("rigel", "kent"), ("HIP71683",)),
    (("Barnards", "star"), ("HIP87937",)), (("El", "Nath"), ("Elnath",)), (("el-nath",), ("Elnath",)),
    (("North", "Star"), ("Polaris",)), (("m", "31"), ("M31",)), (("m31",), ("NGC224",)), (("M-31",), ("ngc", "224")),
    (("andromeda galaxy",), ("M31",)), (("The", "Ring", "Nebula"), ("M57",)), (("47 Tuc Cluster",), ("NGC104",)),
    (("Betelgeuze",), ("Betelgeuse",)), (("alpha", "ori"), ("HIP27989",)), (("ALF", "Orionis"), ("HIP27989",)),
    (("58Ori",), ("HIP27989",)), (("theta1", "Ori"), ("Trapezium",)), (("61", "Cygni"), ("HIP104214",)),
    (("α", "Cen"), ("Rigel", "Kent")), (("beta", "cyg"), ("Albireo",)), (("eta", "Cas"), ("24Cas",)),
    (("NGC7000",), ("North", "America")), (("andromeda",), ("m", "31")), (("Lagoon",), ("M8",)),
    (("Rosette",), ("c49",)), (("lmc",), ("Large", "Magellanic", "Cloud")), (("SMC",), ("NGC292",)),
    (("coathanger",), ("Coathanger", "Asterism")), (("epsilon", "lyr"), ("Double", "Double")),
    (("Veil",), ("ngc-6960",)), (("pleiades",), ("Messier", "45")), (("Caldwell", "14"), ("double", "cluster")),
])  # fmt: skip
def test_name_lookup_ignores_spelling_variants(typed: tuple[str, ...], same: tuple[str, ...]) -> None:
    first, second = spot(*typed), spot(*same)
    assert separation(first.ra, first.dec, second.ra, second.dec) < 1e-6


@each(("typed", "told"), [
    ("Vegga", "there is no object 'Vegga'; did you mean Vega?"),
    ("Betelguese", "did you mean Betelgeuse?"),
    ("Jupitr", "did you mean Jupiter?"),
    ("Lagon", "there is no object 'Lagon'; did you mean Lagoon Nebula?"),
    ("kaus", "did you mean Kaus Media or Kaus Borealis or Kaus Australis?"),
    ("nowhere", "'nowhere' is not a place: write RA DEC, like 05:34:32 +22:00:52"),
    ("", "'' is not a place: write RA DEC"),
    ("NGC99999", "NGC7840"),
    ("M 999", "M110"),
    ("HIP0", "HIP0: the library has no such object"),
    ("the Sun", "no goto to the Sun"),
])  # fmt: skip
def test_unknown_name_is_answered_with_similar_names(typed: str, told: str) -> None:
    with pytest.raises(UserError) as refused:
        spot(typed)
    assert told in str(refused.value)


def test_common_object_names_are_known_without_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> None:
        raise NotInstalled

    monkeypatch.setattr("gateway.astro.catalog.deepsky.data_file", missing)
    monkeypatch.setattr("gateway.astro.catalog.stars.data_file", missing)
    assert spot("Vega").dec == pytest.approx(38.78, abs=0.02)
    assert spot("Ring", "Nebula").ra == pytest.approx(283.4, abs=0.01)
    with pytest.raises(UserError, match=r"^NGC1.* library.*pip install"):
        spot("NGC1")
    with pytest.raises(UserError, match=r"^HIP2.* library.*pip install"):
        spot("HIP2")
    with pytest.raises(UserError, match=r"did you mean Vega\?"):
        spot("Vegga")
    with pytest.raises(UserError) as refused:  # on a phone nobody can type that
        objects.find_object("NGC1")
    assert "pip" not in str(refused.value)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shell_completes_object_names(shell: str) -> None:
    words = completion_script(shell)
    assert "Betelgeuse" in words and "Jupiter" in words
