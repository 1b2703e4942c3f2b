"""The sample of a grid: every value is met as often as was asked for, by few combinations, the same in every run."""

from __future__ import annotations

from collections import Counter
from itertools import product

from tests.support.each import each
from tests.support.sampling import chosen


@each("times", [1, 2])
@each("lengths", [(4, 2, 6), (7, 8), (3, 3, 3, 3)])
def test_sample_of_a_grid_has_every_value(lengths: tuple[int, ...], times: int) -> None:
    rows = list(product(*(range(length) for length in lengths)))
    taken = chosen(rows, times)
    for axis, length in enumerate(lengths):
        met = Counter(rows[number][axis] for number in taken)
        assert len(met) == length and min(met.values()) >= times
    assert len(taken) <= max(lengths) * times + 1
    assert taken == sorted(set(taken)) == chosen(rows, times)


def test_sample_has_no_combination_twice() -> None:
    rows = [*product("ab", "xy")]
    assert len(chosen(rows, 9)) == len(rows)
