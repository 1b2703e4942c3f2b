"""Tests many cheap rows in one pytest item: an item for each would cost pytest several times as much as the test.

`each` is used like ``pytest.mark.parametrize`` and can be stacked. Every row is tried, and every row that fails is
named with its failure. A test that is a coroutine runs anew with every row, on virtual time or, marked ``real_time``,
on the computer's own.
"""

from __future__ import annotations

import asyncio
import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest

from gateway.diagnostics.virtual_time import run


def each(names: str | Sequence[str], rows: Iterable[Any]) -> Callable[[Callable[..., Any]], Callable[..., None]]:
    """Run the test with every row in turn; ``names`` are its parameters, separated by commas if they are one string."""
    given = [name.strip() for name in names.split(",")] if isinstance(names, str) else list(names)
    kept = list(rows)
    assert kept

    def made(test: Callable[..., Any]) -> Callable[..., None]:
        @functools.wraps(test)
        def all_of_them(**others: Any) -> None:
            failed: list[BaseException] = []
            for row in kept:
                values = dict(zip(given, row if len(given) > 1 else (row,), strict=True))
                try:
                    called = test(**others, **values)
                    if inspect.iscoroutine(called):
                        (asyncio.run if _real_time(test, all_of_them) else run)(called)
                except (Exception, BaseExceptionGroup, pytest.fail.Exception) as error:
                    error.add_note(f"with {values}")
                    failed.append(error)
            if len(failed) > 1:
                raise BaseExceptionGroup(f"{len(failed)} of {len(kept)} rows", failed)
            if failed:
                raise failed[0]

        signature = inspect.signature(test)
        left = [parameter for name, parameter in signature.parameters.items() if name not in given]
        all_of_them.__signature__ = signature.replace(parameters=left)  # type: ignore[attr-defined]
        return all_of_them

    return made


def _real_time(test: Callable[..., Any], decorated: Callable[..., None]) -> bool:
    """Return whether the test or its module is marked ``real_time``."""
    marks = [test.__globals__.get("pytestmark"), *getattr(decorated, "pytestmark", [])]
    return any(getattr(mark, "name", "") == "real_time" for mark in marks)
