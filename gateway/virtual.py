"""An event loop whose time is virtual: waiting costs nothing, so a night passes in seconds.

Whenever nothing is ready, time jumps to the next timer. Only for programs that live in one process without real I/O.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from typing import Any


class _Jumping(selectors.SelectSelector):
    """A selector that moves the loop's clock instead of sleeping."""

    loop: VirtualLoop

    def select(self, timeout: float | None = None) -> list[Any]:
        if timeout is not None:
            self.loop.elapsed += timeout
            return []  # nothing is asked of the system: that would take longer than most of what is then done
        ready = super().select(0)
        if not ready:
            raise RuntimeError("nothing will ever happen again")
        return ready


class VirtualLoop(asyncio.SelectorEventLoop):
    """``elapsed`` is the loop's time in seconds."""

    def __init__(self) -> None:
        selector = _Jumping()
        selector.loop = self
        self.elapsed = 1000.0
        super().__init__(selector)

    def time(self) -> float:
        return self.elapsed


def run(program: Coroutine[Any, Any, Any], loop: Callable[[], VirtualLoop] = VirtualLoop) -> Any:
    """Run a coroutine in virtual time."""
    with asyncio.Runner(loop_factory=loop) as runner:
        return runner.run(program)
