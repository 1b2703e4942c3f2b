"""An event loop with virtual time: waiting takes no real time, so a night passes in seconds.

If nothing is ready, time jumps to the next timer. The loop is only for programs within one process without real I/O.
Such programs spend most of their time in loop iterations, so an iteration does less than asyncio's own. Timers that are
due at the same moment run in the order in which they were set.
"""

from __future__ import annotations

import asyncio
import heapq
import selectors
from collections import deque
from collections.abc import Callable, Coroutine
from contextvars import Context, copy_context
from typing import Any, TypeVar

#: Timers less than this apart run in the same iteration, seconds.
TIMER_RESOLUTION = 1e-9
#: With more timers than this, cancelled ones are removed early.
CLEANUP_THRESHOLD = 500

_T = TypeVar("_T")


class _TimerHandle(list[Any]):
    """A timer handle, as a list for speed: time, number, callback (None: cancelled), arguments, context."""

    __slots__ = ()
    __hash__ = object.__hash__  # type: ignore[assignment]  # handles are hashed by identity

    def cancel(self) -> None:
        self[2] = None
        self[3] = ()

    def cancelled(self) -> bool:
        return self[2] is None

    def when(self) -> float:
        return self[0]  # type: ignore[no-any-return]


def _run_handle(handle: asyncio.Handle) -> None:
    if not handle.cancelled():
        handle._run()


class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop with virtual time; ``elapsed`` is its clock, seconds."""

    def __init__(self) -> None:
        self.elapsed = 1000.0
        self._ready_timers: deque[_TimerHandle] = deque()
        self._timers: list[_TimerHandle] = []
        self._timer_count, self._cleanup_threshold = 0, CLEANUP_THRESHOLD
        super().__init__(selectors.SelectSelector())

    def time(self) -> float:
        return self.elapsed

    def get_debug(self) -> bool:
        """Return False without a lookup: asyncio calls this for every future."""
        return False

    # the exact signatures of these four in asyncio cannot be written for this version of Python

    def call_soon(  # type: ignore[override]
        self, callback: Callable[..., object], *args: object, context: Context | None = None
    ) -> _TimerHandle:
        if self._closed:  # type: ignore[attr-defined]
            raise RuntimeError("Event loop is closed")
        handle = _TimerHandle((0.0, 0, callback, args, copy_context() if context is None else context))
        self._ready_timers.append(handle)
        return handle

    def call_soon_threadsafe(  # type: ignore[override]
        self, callback: Callable[..., object], *args: object, context: Context | None = None
    ) -> _TimerHandle:
        handle = self.call_soon(callback, *args, context=context)
        self._write_to_self()  # type: ignore[attr-defined]
        return handle

    def call_at(  # type: ignore[override]
        self, when: float, callback: Callable[..., object], *args: object, context: Context | None = None
    ) -> _TimerHandle:
        if self._closed:  # type: ignore[attr-defined]
            raise RuntimeError("Event loop is closed")
        self._timer_count += 1
        handle = _TimerHandle((when, self._timer_count, callback, args, copy_context() if context is None else context))
        heapq.heappush(self._timers, handle)
        return handle

    def call_later(  # type: ignore[override]
        self, delay: float, callback: Callable[..., object], *args: object, context: Context | None = None
    ) -> _TimerHandle:
        return self.call_at(self.elapsed + delay, callback, *args, context=context)

    def _add_callback(self, handle: asyncio.Handle) -> None:
        """Schedule asyncio's own handle of a file descriptor that is ready."""
        self.call_soon(_run_handle, handle)

    def _run_once(self) -> None:
        """Run all ready callbacks; if none is ready, advance the clock to the next timers. Repeat until stopped."""
        soon, timers = self._ready_timers, self._timers
        take, pop = soon.popleft, heapq.heappop
        while True:
            while timers and timers[0][2] is None:
                pop(timers)
            if not soon and not self._stopping:  # type: ignore[attr-defined]
                self._wait()
            if timers:
                end = self.elapsed + TIMER_RESOLUTION
                while timers and timers[0][0] < end:
                    soon.append(pop(timers))
            for _ in range(len(soon)):
                _, _, callback, arguments, context = take()
                if callback is not None:
                    try:
                        context.run(callback, *arguments)
                    except (SystemExit, KeyboardInterrupt):
                        raise
                    except BaseException as error:
                        self.call_exception_handler({"message": f"Exception in {callback!r}", "exception": error})
            if self._stopping:  # type: ignore[attr-defined]
                return

    def _wait(self) -> None:
        """Advance the clock to the next timer; without timers, handle file descriptors that are ready."""
        timers = self._timers
        if len(timers) > self._cleanup_threshold:
            timers[:] = [due for due in timers if due[2] is not None]
            heapq.heapify(timers)
            self._cleanup_threshold = max(CLEANUP_THRESHOLD, 2 * len(timers))
        if timers:  # without a system call, which would take longer than most callbacks
            self.elapsed += max(0.0, timers[0][0] - self.elapsed)
            return
        ready = self._selector.select(0)  # type: ignore[attr-defined]
        if not ready:
            raise RuntimeError("nothing will ever happen again")
        self._process_events(ready)  # type: ignore[attr-defined]

    def close(self) -> None:
        super().close()
        self._ready_timers.clear()
        self._timers.clear()


def run(program: Coroutine[object, object, _T], make_loop: Callable[[], VirtualLoop] = VirtualLoop) -> _T:
    """Run a coroutine in virtual time, and return its result."""
    with asyncio.Runner(loop_factory=make_loop) as runner:
        return runner.run(program)
