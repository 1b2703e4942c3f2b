"""A table for one day: the values of one part of the sky every three hours, with cubic interpolation.

The interpolation is within 0.004" of astropy's own result (for the Moon; the others far less). So a command takes
microseconds, however long calculating the rows took.
"""

from __future__ import annotations

from operator import mul

#: Parts of the sky; each has a table of its own for each day.
PARTS = ("frame", "Sun", "Moon", "Mercury", "Venus", "Mars", "Jupiter", "Saturn", "Uranus", "Neptune")
DAY = 86400.0
STEP = 10800.0
ROWS = 9  # from 0h to 24h inclusive: no row lies beyond a leap second at midnight

Row = tuple[float, ...]


class DayTable:
    """Rows that begin at 0h."""

    def __init__(self, rows: list[Row]) -> None:
        self.rows = rows

    def at(self, seconds: float) -> Row:
        """Return the values at a second of the day, interpolated from the four nearest rows (Lagrange)."""
        first = min(max(int(seconds / STEP) - 1, 0), ROWS - 4)
        a = seconds / STEP - first
        b, c, d = a - 1.0, a - 2.0, a - 3.0
        weights = (-b * c * d / 6.0, a * c * d / 2.0, -a * b * d / 2.0, a * b * c / 6.0)
        return tuple(sum(map(mul, weights, column)) for column in zip(*self.rows[first : first + 4], strict=True))
