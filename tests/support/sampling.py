"""Of a grid of combinations a sample: every value of every axis is met, in safety and stops twice.

Stacked ``parametrize`` marks make the product of their values, of which most combinations show nothing that others do
not. What plays a whole gateway costs a hundred times what a unit costs, so such grids are sampled; ``pytest --whole``
plays every combination. The sample is the same in every run. What one test goes through by itself asks
`as_a_rule` how much of it. The mark ``sampled(times)`` asks for every value so often, and ``sampled(every=2)`` takes
every second one of what would be played.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from itertools import combinations, groupby
from typing import TypeVar
from zlib import crc32

import pytest

Amount = TypeVar("Amount", int, float)
#: Whether everything is played; ``tests/conftest.py`` sets it before it imports the tests.
WHOLE = False
#: Up to how many combinations nothing is left out.
FEW = 3
#: Where whole gateways are played, and how often every value is met at least; elsewhere the mark ``sampled`` says so.
FOLDERS = {"tests/integration/safety/": 2, "tests/integration/stops/": 2, "tests/integration/": 1}
#: Of a plain list every second one is played there, where each is met once: of some tests the first, of others the
#: second, so that every mount is met all the same.
HALF = 2


def as_a_rule(number: Amount, *, whole: Amount) -> Amount:
    """This number, and the other one with ``pytest --whole``."""
    return whole if WHOLE else number


def chosen(rows: Sequence[tuple[Hashable, ...]], times: int) -> list[int]:
    """Which rows are in the sample: as few as it takes, and as different from each other as can be."""
    met: Counter[Hashable] = Counter()
    taken: list[int] = []
    pairs = [set(combinations(enumerate(row), 2)) for row in rows]
    seen: set[Hashable] = set()

    def gain(number: int) -> tuple[int, int, int]:
        values = list(enumerate(rows[number]))
        return (
            sum(met[value] < times for value in values),
            len(pairs[number] - seen),
            -sum(met[value] for value in values),
        )

    left = list(range(len(rows)))
    while left:
        best = max(left, key=gain)
        if not gain(best)[0]:
            break
        met.update(enumerate(rows[best]))
        seen |= pairs[best]
        taken.append(best)
        left.remove(best)
    return sorted(taken)


def left_out(items: Iterable[pytest.Item]) -> set[pytest.Item]:
    """What the sample does without, of tests that stand in the order in which they were collected."""
    out: set[pytest.Item] = set()
    for function, together in groupby(items, key=lambda item: item.nodeid.partition("[")[0]):
        grid = list(together)
        mark = grid[0].get_closest_marker("sampled")
        times = next((often for folder, often in FOLDERS.items() if function.startswith(folder)), 0)
        if mark is None and (len(grid) <= FEW or not times):
            continue
        rows = [_row(item) for item in grid]
        plain = len(rows[0]) == 1
        if mark:
            times, every, first = (mark.args or (times or 2,))[0], mark.kwargs.get("every", 1), 0
        else:
            every = HALF if plain and times == 1 else 1
            first = crc32(function.encode()) % every
        keep = set((range(len(grid)) if plain else chosen(rows, times))[first::every])
        out.update(item for number, item in enumerate(grid) if number not in keep)
    return out


def _row(item: pytest.Item) -> tuple[str, ...]:
    """What it has on each axis; names that are set together are one axis."""
    spec = getattr(item, "callspec", None)
    axes = [mark.args[0] for mark in item.iter_markers("parametrize")] if spec else []
    names = [[name.strip() for name in axis.split(",")] if isinstance(axis, str) else axis for axis in axes]
    return tuple(repr([spec.params[name] for name in axis]) for axis in names)
