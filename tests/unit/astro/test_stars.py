"""Stars by their numbers in SAO, HD and HR: where the list of them is installed, and where it is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.app.control.objects import NotSupplied, describe, find
from gateway.astro.catalog import objects, stars
from gateway.core.errors import UserError
from tests.support.each import each
from tests.support.fake_mount import Talk

#: As fchart3 lays it down: Hipparcos number, component, SAO, HD, HR. Polaris, Castor's two, Betelgeuse, Vega.
LIST = (
    "# HIP\t\tSAO\tHD\tHR\n11767\t\t308\t8890\t424\n36850\tA\t60198\t60179\t2891\n36850\tB\t60198\t60178\t2890\n"
    "27989\t\t113271\t39801\t2061\n91262\t\t67174\t172167\t7001\n113\t\t\t224881\t\n"
)


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The list, in the place of an installed one."""
    path = tmp_path / "cross-id.dat"
    path.write_text(LIST, newline="")

    def data_file(package: str, name: str) -> Path:
        if package != stars.CROSS_PACKAGE:
            return objects.data_file(package, name)
        if not path.exists():
            raise objects.NotInstalled
        return path

    monkeypatch.setattr(stars, "data_file", data_file)
    return path


@each(
    ("catalogue", "number", "hipparcos"),
    [
        ("SAO", 113271, 27989), ("HD", 39801, 27989), ("HR", 2061, 27989), ("HR", 7001, 91262), ("HD", 172167, 91262),
        ("SAO", 67174, 91262), ("HR", 424, 11767), ("SAO", 308, 11767), ("SAO", 60198, 36850), ("HD", 224881, 113),
    ],
)  # fmt: skip
def test_a_star_is_found_by_its_other_numbers(catalogue: str, number: int, hipparcos: int) -> None:
    entry, star = stars.by_other_number(catalogue, number, 2026.0), stars.hipparcos(hipparcos, 2026.0)
    assert entry is not None and star is not None
    assert (entry.name, entry.ra, entry.dec) == (f"{catalogue}{number}", star.ra, star.dec)


@each(
    ("catalogue", "number"),
    [
        ("HD", 7001),
        ("SAO", 39801),
        ("HR", 27989),
        ("HR", 224881),
        ("HD", 3980),
        ("HD", 9801),
        ("SAO", 0),
        ("HR", 11767),
    ],
)
def test_a_number_counts_whole_and_in_its_own_catalogue(catalogue: str, number: int) -> None:
    assert stars.hipparcos_number(catalogue, number) is None


def test_a_person_types_any_of_them() -> None:
    places = [find(number) for number in ("HD 39801", "hr2061", "SAO-113271", "HIP 27989")]
    for one in places[1:]:  # each is where the star is at the moment of the question
        assert (one.ra, one.dec, one.j2000) == pytest.approx((places[0].ra, places[0].dec, True), abs=2e-6)
    assert describe("HD 39801").kind == "star"
    with pytest.raises(UserError, match="HD39802: the library has no such object"):
        find("HD 39802")


def test_without_the_list_a_person_is_told_what_to_do(installed: Path) -> None:
    installed.unlink()
    with pytest.raises(NotSupplied, match=r"HD39801: .* is not installed") as told:
        find("HD 39801")
    assert "pip" not in str(told.value) and " fchart3 " in told.value.remedy


def test_a_program_chooses_their_catalogues(installed: Path) -> None:
    talk = Talk(model="lx200")
    assert talk.send(b":Ls1#:LS113271#:LI#") == b"1SAO113271 STAR MAG 0.4#"
    assert talk.send(b":Ls4#:LS7001#:LI#") == b"1HR7001 STAR MAG 0.0#"
    assert talk.send(b":Ls5#:LS172167#:LI#") == b"1HD172167 STAR MAG 0.0#"
    assert talk.send(b":LS172168#:LI#:MS#") == b"HD 172168 not found#1HD 172168 not found#"
    installed.unlink()
    assert talk.send(b":Ls5#:LI#:MS#") == b"2Star catalog not installed.#1Star catalog not installed.#"
