"""The short version of ``python -m tests.support.rates``: a Meade with every register, one without, two NexStars."""

from __future__ import annotations

import pytest

from tests.support.rates import over_meade, over_nexstar


@pytest.mark.parametrize("model", ["lx200gps", "lx200"])
def test_nexstar_rates_over_a_meade_are_those_that_the_tables_name(model: str) -> None:
    rows = over_meade(model, (7.5, 15.0, -150.0, 3600.0), (1, 6, 9))
    assert [row.line() for row in rows if row.fails] == []


@pytest.mark.parametrize(("model", "version", "first"), [("avx", "5.31", b""), ("nexstar-gps", "2.2", b"T\2")])
def test_lx200_rates_over_a_nexstar_are_those_that_were_asked_for(model: str, version: str, first: bytes) -> None:
    rows = over_nexstar(model, version, first, (3.0, 15.0))
    assert [row.line() for row in rows if row.fails] == []
