"""Many rows in one test, where each takes next to no time: an item of its own costs pytest several times as much.

It stands where ``pytest.mark.parametrize`` would stand. A row that fails is named with the failure, and those behind
it are not tried.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable
from typing import Any


def each(names: str, rows: Iterable[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """The test with every row in turn; ``names`` are those of its parameters, with commas between them."""
    given, kept = [name.strip() for name in names.split(",")], list(rows)
    assert kept

    def made(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def all_of_them(**others: Any) -> None:
            for row in kept:
                values = dict(zip(given, row if len(given) > 1 else (row,), strict=True))
                try:
                    test(**others, **values)
                except BaseException as error:
                    error.add_note(f"with {values}")
                    raise

        signature = inspect.signature(test)
        left = [parameter for name, parameter in signature.parameters.items() if name not in given]
        all_of_them.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        return all_of_them

    return made
