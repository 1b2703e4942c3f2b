"""The parameters of a request, and the ranges that they must be in."""

from __future__ import annotations

from typing import Any

from gateway.core.errors import Invalid
from gateway.core.operations import Values
from gateway.protocols.base.wants import given


def within(values: Values, field: str, name: str, low: float, high: float, per: float = 1.0) -> Any:
    """A parameter that is in its range, which is told in units of ``per``. Raises Invalid."""
    value = given(values)[field]
    if not low <= value <= high:
        raise Invalid(f"{name} is {value / per:.10g}; it must be from {low / per:.6g} to {high / per:.6g}.")
    return value


def place(values: Values) -> tuple[float, float]:
    """Right ascension and declination, degrees. Raises Invalid."""
    ra = within(values, "ra", "RightAscension", 0.0, 360.0, per=15.0)
    return ra % 360.0, within(values, "dec", "Declination", -90.0, 90.0)


def axis(values: Values) -> int:
    """0 for the first axis, 1 for the second, 2 for a third that no mount has. Raises Invalid."""
    found: int = within(values, "axis", "Axis", 0, 2)
    return found
