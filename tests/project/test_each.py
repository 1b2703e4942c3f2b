"""``each`` tries every row, names the one that fails, and leaves the other parameters to pytest."""

from __future__ import annotations

import inspect

import pytest

from tests.support.each import each


def test_a_row_that_fails_is_named() -> None:
    @each("first, second", [(1, 1), (2, 3), (4, 5)])
    def test(first: int, second: int) -> None:
        assert first == second

    with pytest.raises(AssertionError) as failed:
        test()
    assert failed.value.__notes__ == ["with {'first': 2, 'second': 3}"]


def test_what_each_leaves_is_asked_of_pytest() -> None:
    seen: list[tuple[int, str]] = []

    @each("number", range(3))
    def test(number: int, other: str) -> None:
        seen.append((number, other))

    assert list(inspect.signature(test).parameters) == ["other"]
    test(other="x")
    assert seen == [(0, "x"), (1, "x"), (2, "x")]
