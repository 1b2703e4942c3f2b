"""``each`` tries every row, names those that fail, and leaves the other parameters to pytest."""

from __future__ import annotations

import pytest

from tests.support.each import each


def test_each_decorator_names_every_failing_row() -> None:
    @each("first", [1, 2])
    @each(("second", "third"), [(1, 1), (2, 2), (3, 3)])
    def test(first: int, second: int, third: int) -> None:
        assert first == second
        if third == 2:
            pytest.fail("no two")

    with pytest.raises(BaseExceptionGroup) as failed:
        test()
    one, two = failed.value.exceptions
    assert isinstance(one, BaseExceptionGroup) and isinstance(two, BaseExceptionGroup)
    assert (one.__notes__, two.__notes__) == (["with {'first': 1}"], ["with {'first': 2}"])
    assert [error.__notes__ for error in one.exceptions] == [
        ["with {'second': 2, 'third': 2}"],
        ["with {'second': 3, 'third': 3}"],
    ]
    assert len(two.exceptions) == 3
