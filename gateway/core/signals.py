"""A typed signal: how a part tells what has happened, without knowing who needs to know.

It is synchronous: every listener has acted, in the order in which they were connected, when ``emit`` returns. A limit
can so be kept in the turn of the loop in which the position came. What a listener raises reaches whoever emits.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Signal(Generic[T]):
    """Something that happens, with a value that says what."""

    __slots__ = ("_listeners", "count")

    def __init__(self) -> None:
        self._listeners: tuple[Callable[[T], object], ...] = ()
        #: How often it has happened.
        self.count = 0

    def connect(self, listener: Callable[[T], object]) -> None:
        """Have this called, with the value, whenever it happens from now on."""
        self._listeners = (*self._listeners, listener)

    def disconnect(self, listener: Callable[[T], object]) -> None:
        self._listeners = tuple(one for one in self._listeners if one != listener)

    def emit(self, value: T) -> None:
        self.count += 1
        for listener in self._listeners:
            listener(value)
