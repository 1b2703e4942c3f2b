"""Rates measured at the axes: a Meade with every register, one without, two NexStars; all of them with ``--whole``."""

from __future__ import annotations

import pytest

from tests.support.rates import KEYS, MEADES, NEXSTARS, VARIABLE, over_meade, over_nexstar
from tests.support.sampling import as_a_rule


@pytest.mark.parametrize("model", as_a_rule(("lx200gps", "lx200"), whole=MEADES))
def test_meade_moves_at_the_nexstar_rates_of_the_tables(model: str) -> None:
    rows = over_meade(model, as_a_rule((7.5, 15.0, -150.0, 3600.0), whole=VARIABLE), as_a_rule((1, 6, 9), whole=KEYS))
    assert [row.line() for row in rows if row.fails] == []


@pytest.mark.parametrize(
    ("model", "version", "first"), as_a_rule((("avx", "5.31", b""), ("nexstar-gps", "2.2", b"T\2")), whole=NEXSTARS)
)
def test_nexstar_moves_at_the_lx200_rates_that_were_requested(model: str, version: str, first: bytes) -> None:
    rows = over_nexstar(model, version, first, (3.0, 15.0))
    assert [row.line() for row in rows if row.fails] == []
