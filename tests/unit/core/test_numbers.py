"""Operations hold numbers only, and no declination beyond a pole."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import pytest

from gateway.core import operations as op
from gateway.core.errors import Invalid
from tests.support.each import each

_NORTH = op.Direction.NORTH
MADE: list[Callable[[Any], op.Operation]] = [
    lambda value: op.Goto(value, 10.0),
    lambda value: op.Goto(10.0, value),
    lambda value: op.Goto(10.0, 10.0, lowest=value),
    lambda value: op.Sync(value, 10.0),
    lambda value: op.Sync(10.0, value),
    lambda value: op.GotoHorizontal(10.0, value),
    lambda value: op.GotoAxes(value, 10.0),
    lambda value: op.MoveAxis(1, 1, op.Rate(degrees=value)),
    lambda value: op.Pulse(op.Direction.NORTH, value),
    lambda value: op.SetSite(value, 10.0),
    lambda value: op.SetClock(value, 0.0),
]


@pytest.mark.parametrize("make", MADE)
@pytest.mark.parametrize("value", [nan, inf, -inf, "05:34:32", 10**400, True, [1.0], 1j])
def test_value_that_is_no_number_is_refused_in_a_sentence(make: Callable[[Any], op.Operation], value: object) -> None:
    with pytest.raises(Invalid, match=r"^The [A-Za-z ]+ must be a number.*\.$"):
        make(value)
    assert make(12) == make(12.0)


def test_required_number_cannot_be_left_out() -> None:
    missing: Any = None
    for make in (lambda: op.Goto(missing, 10.0), lambda: op.Sync(10.0, missing), lambda: op.Move(_NORTH, missing)):
        with pytest.raises(Invalid, match=r"must be a number.*, not None"):
            make()
    assert op.Goto(10.0, 10.0, lowest=None) and op.SetSite(48.1) and op.Move(_NORTH, op.Rate("guide"))


@pytest.mark.parametrize("dec", [90.001, -95.0])
def test_declination_beyond_a_pole_is_refused(dec: float) -> None:
    for make in (op.Goto, op.Sync, op.GotoHorizontal):
        assert make(10.0, 90.0) and make(10.0, -90.0)
        with pytest.raises(Invalid, match="from -90 to 90"):
            make(10.0, dec)
    assert op.GotoAxes(10.0, dec).alt == dec


@each(
    ("make", "words"),
    [
        (lambda: op.MoveAxis(7, 1, op.Rate("find")), "The axis must be 1 or 2, not 7."),
        (lambda: op.MoveAxis(1, 5, op.Rate("find")), "The sense must be 1 or -1, not 5."),
        (lambda: op.StopAxis(0), "The axis must be 1 or 2, not 0."),
        (lambda: op.Backlash(1, 10, 2), "The sense must be 1 or -1 or 0, not 2."),
        (lambda: op.PeriodicError(3), "The axis must be 1 or 2 or None, not 3."),
        (lambda: op.Rate("warp"), "The rate must be guide, center, find or max, not 'warp'."),
        (lambda: op.Rate(key=10), "The key of a rate must be 1 to 9, not 10."),
    ],
)
def test_unknown_motor_number_is_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(Invalid) as caught:
        make()
    assert str(caught.value) == words
