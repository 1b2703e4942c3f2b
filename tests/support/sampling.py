"""Samples a grid of combinations so that every value of every axis occurs; in tests of safety and stops, twice.

Stacked ``parametrize`` marks multiply their values, and most combinations show nothing that others do not. A test of a
whole gateway costs a hundred times as much as a unit test, so such grids are sampled; ``pytest --whole`` runs every
combination. The sample is the same in every run. A test that loops over cases itself asks `as_a_rule` how many to take.
The mark ``sampled(times)`` asks for every value that many times, and ``sampled(every=2)`` takes every second item of
what would be run.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from itertools import combinations, groupby
from typing import TypeVar
from zlib import crc32

import pytest

Amount = TypeVar("Amount")
#: Whether everything is run; ``tests/conftest.py`` sets it before it imports the tests.
WHOLE = False
#: Grids of up to this many combinations are not sampled.
FEW = 3
#: Folders of tests with whole gateways, and how often every value occurs at least; the mark ``sampled`` overrides it.
FOLDERS = {"tests/integration/safety/": 2, "tests/integration/stops/": 2, "tests/integration/": 1,
           "tests/programs/": 1}  # fmt: skip
#: In folders where each value occurs once, a plain list is run only at every second value: for some tests the first,
#: for others the second, so that every mount is tested all the same.
HALF = 2


def as_a_rule(number: Amount, *, whole: Amount) -> Amount:
    """Return ``number``, or ``whole`` with ``pytest --whole``."""
    return whole if WHOLE else number


def chosen(rows: Sequence[tuple[Hashable, ...]], times: int) -> list[int]:
    """Return the indices of the sampled rows: as few as possible, and as different from each other as possible."""
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
    """Return the tests that the sample omits; ``items`` are in the order of collection."""
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
    """Return the test's value on each axis; names that are set together are one axis."""
    spec = getattr(item, "callspec", None)
    axes = [mark.args[0] for mark in item.iter_markers("parametrize")] if spec else []
    names = [[name.strip() for name in axis.split(",")] if isinstance(axis, str) else axis for axis in axes]
    return tuple(repr([spec.params[name] for name in axis]) for axis in names)
