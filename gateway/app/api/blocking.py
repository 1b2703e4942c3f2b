"""A gateway for programs without an event loop: the methods of ``RunningGateway``, each of which waits for its result.

The gateway runs on an event loop in a thread of its own, with nothing left out: other programs are served while this
one waits or calculates. The methods are those of ``RunningGateway``, passed on to that thread; their signatures are
derived, so that type checkers know them. Several threads may use one gateway.
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import functools
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import CancelledError, Future, wait
from typing import Concatenate, ParamSpec, TypeVar

from gateway.app.api.embedding import RunningGateway, open_gateway, shown
from gateway.core.errors import NoAnswer, UserError

_P = ParamSpec("_P")
_T = TypeVar("_T")
#: Seconds between two looks for Ctrl-C, to which a wait without a limit is deaf on Windows.
LOOK = 0.2


def _waits(
    method: Callable[Concatenate[RunningGateway, _P], Coroutine[object, object, _T]],
) -> Callable[Concatenate[BlockingGateway, _P], _T]:
    """Return a method of ``RunningGateway`` as one of ``BlockingGateway`` that waits for its result."""

    @functools.wraps(method)
    def waits(self: BlockingGateway, /, *arguments: _P.args, **named: _P.kwargs) -> _T:
        return self._thread.result(lambda gateway: method(gateway, *arguments, **named))

    return waits


class BlockingGateway:
    """One mount whose surfaces are open, and whose methods wait. Made by ``open_blocking_gateway``.

    Everything is as in ``RunningGateway``. Ctrl-C ends the wait, and as it leaves the block, it stops the mount.
    """

    def __init__(self, thread: _Thread) -> None:
        self._thread = thread

    ready = _waits(RunningGateway.ready)
    position = _waits(RunningGateway.position)
    goto = _waits(RunningGateway.goto)
    arrived = _waits(RunningGateway.arrived)
    moving = _waits(RunningGateway.moving)
    sync = _waits(RunningGateway.sync)
    site = _waits(RunningGateway.site)
    time = _waits(RunningGateway.time)
    stop = _waits(RunningGateway.stop)
    perform = _waits(RunningGateway.perform)

    @property
    def addresses(self) -> list[str]:
        """As in ``RunningGateway``."""
        return self._thread.gateway.addresses

    @property
    def ended_short(self) -> str:
        """As in ``RunningGateway``."""
        return self._thread.gateway.ended_short


class _Thread(threading.Thread):
    """Runs an event loop on which one gateway is open until ``end``, which ``atexit`` calls at the latest: were the
    thread no daemon, Python would wait for the thread before that, for ever.
    """

    gateway: RunningGateway

    def __init__(self, opening: contextlib.AbstractAsyncContextManager[RunningGateway]) -> None:
        super().__init__(name="mount-gateway", daemon=True)
        self._opening, self._begun, self._asked = opening, threading.Event(), False
        #: When the gateway is open, and when it is closed; either has the error instead, if there is one.
        self.opened, self.closed = Future[None](), Future[None]()

    def run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            (self.closed if self.opened.done() else self.opened).set_exception(error)
        if not self.closed.done():
            self.closed.set_result(None)

    async def _serve(self) -> None:
        serving = asyncio.current_task()
        assert serving is not None
        self._loop, self._leave = asyncio.get_running_loop(), serving.cancel
        self._begun.set()
        with contextlib.suppress(asyncio.CancelledError):
            async with self._opening as self.gateway:
                self.opened.set_result(None)
                await asyncio.Event().wait()

    def result(self, call: Callable[[RunningGateway], Coroutine[object, object, _T]]) -> _T:
        """Carry out a call on the thread, wait for it, and return its result. Raises what it raises."""

        async def called() -> _T:
            return await call(self.gateway)

        if threading.current_thread() is self:
            raise RuntimeError("A gateway that waits cannot be used on its own thread, by watch or warn.")
        if self._asked:
            raise NoAnswer("The gateway is closed.")
        calling = asyncio.run_coroutine_threadsafe(called(), self._loop)
        try:
            return _result(calling)
        except CancelledError:  # another thread has left the block meanwhile
            raise NoAnswer("The gateway is closed.") from None
        finally:
            calling.cancel()

    def end(self) -> None:
        """Stop the mount, close the gateway, and wait until that is done. Raises what closing raises."""
        self._begun.wait()
        if not self._asked:
            self._asked = True
            with contextlib.suppress(RuntimeError):  # the loop is closed: it could not be opened
                self._loop.call_soon_threadsafe(self._leave)
        _result(self.closed)


def _result(future: Future[_T]) -> _T:
    """Wait for a result in such a way that Ctrl-C ends the wait on every system."""
    while not wait((future,), LOOK).done:
        pass
    return future.result()


def _in_a_thread(
    opens: Callable[_P, contextlib.AbstractAsyncContextManager[RunningGateway]],
) -> Callable[_P, contextlib.AbstractContextManager[BlockingGateway]]:
    """Return ``open_gateway``, with all that can be set there, for programs without an event loop."""

    @functools.wraps(opens, assigned=())
    @contextlib.contextmanager
    def open_blocking_gateway(*arguments: _P.args, **settings: _P.kwargs) -> Iterator[BlockingGateway]:
        """Open a mount as ``open_gateway`` does, for a program without an event loop: ``with``, not ``async with``.

        ``warn`` and ``watch`` are called on the gateway's thread. Leaving the block stops the mount and closes
        everything; so does the end of the program, if it does not leave it.
        """
        thread = _Thread(opens(*arguments, **settings))
        thread.start()
        atexit.register(thread.end)
        try:
            try:
                _result(thread.opened)
            except UserError as error:
                raise UserError(str(error).replace("open_gateway:", "open_blocking_gateway:", 1)) from None
            yield BlockingGateway(thread)
        finally:
            thread.end()
            atexit.unregister(thread.end)

    return open_blocking_gateway


open_blocking_gateway = _in_a_thread(open_gateway)
shown(open_blocking_gateway, "AbstractContextManager[BlockingGateway]")
