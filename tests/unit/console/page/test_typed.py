"""Coordinates that are typed: what is clear is taken, what can be meant in two ways is asked and never guessed."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.each import each
from tests.unit.console.page.node import ask


def typed(text: str) -> Any:
    [told] = ask(("typed", text))
    return told


@each(
    ("text", "ra", "dec", "j2000"),
    [
        ("05:34:32 +22:00:52", 83.6333, 22.0144, None),
        ("5h34m32s +22d00m52s J2000", 83.6333, 22.0144, True),
        ("5h 34m 32s, −22° 00′ 52″ of date", 83.6333, -22.0144, False),
        ("RA 12 30 45 Dec -0 23 28", 187.6875, -0.3911, None),
        ("83.63 +22.01 (ICRS)", 83.63, 22.01, True),
        ("5.588h -5.39", 83.82, -5.39, None),
        ("5:34 -22", 83.5, -22.0, None),
        ("0 0 0 0 0 0", 0.0, 0.0, None),
    ],
)
def test_page_accepts_unambiguous_typed_coordinates(text: str, ra: float, dec: float, j2000: bool | None) -> None:
    told = typed(text)
    assert (told["ra"], told["dec"]) == pytest.approx((ra, dec), abs=1e-4)
    assert told["j2000"] is j2000


@each(
    ("text", "asks", "choices"),
    [
        ("5.588 -5.39", "hours or degrees", ["05h 35m 16.8s −05° 23′ 24″", "00h 22m 21.1s −05° 23′ 24″"]),
        ("12 30 45 12 23 28", "north or south", ["12h 30m 45.0s +12° 23′ 28″", "12h 30m 45.0s −12° 23′ 28″"]),
        (
            "5h34m32s 22d00m52s J2000",
            "north or south",
            ["05h 34m 32.0s +22° 00′ 52″ J2000", "05h 34m 32.0s −22° 00′ 52″ J2000"],
        ),
        ("83.63, 22", "north or south", ["05h 34m 31.2s +22° 00′ 00″", "05h 34m 31.2s −22° 00′ 00″"]),
        ("5:75:00 +22", "0 to 59", []),
        ("5:34 +22:60", "0 to 59", []),
        ("5:34:60 +22", "0 to 59", []),
        ("12 30.5 45 +3", "fraction", []),
        ("24:00 +10", "24 hours", []),
        ("361 +10", "360 degrees", []),
        ("12:30 +91", "−90 to +90", []),
        ("12 34 56", "sign", []),
        ("−5 30 12", "no sign", []),
        ("12 30 -5 -30", "one sign", []),
    ],
)
def test_page_asks_about_ambiguous_typed_coordinates(text: str, asks: str, choices: list[str]) -> None:
    told = typed(text)
    assert asks in told["asks"] and told["choices"] == choices
    for one in choices:  # each of them can be meant in one way
        assert "ra" in typed(one)


@each(
    ("text", "alt", "az"),
    [("alt 45 az 180", 45.0, 180.0), ("Az 180.5, Alt 30:15", 30.25, 180.5), ("altitude 5° azimuth 360°", 5.0, 0.0)],
)
def test_page_accepts_typed_altitude_and_azimuth(text: str, alt: float, az: float) -> None:
    assert typed(text) == {"alt": alt, "az": az}


@each("text", ["M31", "61 Cyg", "47 Tuc", "NGC 7000", "3C 273", "alpha ori", "Altair", "Azha", "42", ""])
def test_page_does_not_take_names_for_coordinates(text: str) -> None:
    assert typed(text) is None
