"""A typed signal: a part reports an event, and every listener that has been connected is called.

It is synchronous: when ``emit`` returns, all listeners have been called, in the order in which they were connected.
Thus a limit is enforced in the loop iteration of the reading. An exception reaches the emitter and ends the calls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Signal(Generic[T]):
    """An event that listeners subscribe to; ``emit`` passes them a value."""

    __slots__ = ("_listeners", "count")

    def __init__(self) -> None:
        self._listeners: tuple[Callable[[T], object], ...] = ()
        #: How often it was emitted.
        self.count = 0

    def connect(self, listener: Callable[[T], object]) -> None:
        """Call ``listener`` with the value at every ``emit`` from now on."""
        self._listeners = (*self._listeners, listener)

    def disconnect(self, listener: Callable[[T], object]) -> None:
        self._listeners = tuple(other for other in self._listeners if other != listener)

    def emit(self, value: T) -> None:
        self.count += 1
        for listener in self._listeners:
            listener(value)
