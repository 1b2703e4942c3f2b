"""The result of a measurement: a value, what it is compared with, the goal, and whether the goal is met."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple


class Figure(NamedTuple):
    """One line of the table. ``ratio`` is ``value / reference``; a goal is the largest acceptable value or ratio."""

    name: str
    value: float
    unit: str
    reference: float | None = None
    goal: float | None = None

    @property
    def ratio(self) -> float | None:
        return self.value / self.reference if self.reference else None

    @property
    def met(self) -> bool | None:
        """Whether the goal is met; None without a goal."""
        if self.goal is None:
            return None
        return (self.value if self.ratio is None else self.ratio) <= self.goal

    def row(self) -> tuple[str, ...]:
        """Return the cells of the table."""
        reference = "" if self.reference is None else f"{self.reference:.1f}"
        ratio = "" if self.ratio is None else f"{self.ratio:.2f}"
        goal = "" if self.goal is None else f"<= {self.goal:g}{' x' if self.ratio is not None else ''}"
        verdict = {None: "", True: "met", False: "MISSED"}[self.met]
        return self.name, f"{self.value:.1f}", self.unit, reference, ratio, goal, verdict


HEADINGS = ("figure", "value", "unit", "against", "ratio", "goal", "")


def table(figures: Sequence[Figure]) -> str:
    """Return the figures in columns, text to the left and numbers to the right."""
    rows = [HEADINGS, *(figure.row() for figure in figures)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADINGS))]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if column in (1, 3, 4) else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def middle(samples: Sequence[float]) -> float:
    """Return the median."""
    return float(median(samples))


def percentile(samples: Sequence[float], percent: float) -> float:
    """Return the sample that ``percent`` of a hundred samples do not exceed."""
    return sorted(samples)[min(len(samples) - 1, int(len(samples) * percent / 100.0))]
