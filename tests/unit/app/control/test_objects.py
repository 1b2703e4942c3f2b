"""What is suggested while somebody types the name of an object."""

from __future__ import annotations

import pytest

from gateway.app.control.objects import completions
from tests.support.each import each

MOST = 12


@each(
    ("typed", "first"),
    [
        ("ma", "Mars"),
        ("sun", "Sun"),
        ("m3", "M 3"),
        ("m 11", "M 11"),
        ("M110", "M 110"),
        ("ngc 7000", "NGC 7000"),
        ("alde", "Aldebaran"),
        ("alkai", "Alkaid"),
        ("ring neb", "Ring Nebula"),
    ],
)
def test_best_object_match_is_suggested_first(typed: str, first: str) -> None:
    assert completions(typed, MOST)[0] == first


def test_every_messier_object_with_the_typed_prefix_is_suggested() -> None:
    assert completions("m3", MOST)[:11] == ["M 3", *(f"M {number}" for number in range(30, 40))]


def test_alignment_stars_are_suggested_first() -> None:
    found = completions("al", 40)
    assert found.index("Altair") < found.index("Albali") < found.index("Alcaid")


@pytest.mark.parametrize("typed", ["", "m999", "ngc 9999", "xyz 12", "m0"])
def test_unknown_text_suggests_no_object(typed: str) -> None:
    assert completions(typed, MOST) == []
