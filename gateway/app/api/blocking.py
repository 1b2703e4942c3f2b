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
from queue import Empty, SimpleQueue
from typing import Concatenate, ParamSpec, TypeVar

from gateway.app.api.embedding import RunningGateway, open_gateway, shown
from gateway.core.errors import NoAnswer, UserError

_P = ParamSpec("_P")
_T = TypeVar("_T")
#: Seconds between two looks for Ctrl-C, to which a wait without a limit is deaf on Windows.
LOOK = 0.2
CLOSED = "The gateway is closed."


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
    goto_object = _waits(RunningGateway.goto_object)
    park = _waits(RunningGateway.park)
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
        self._opening, self._asked = opening, False
        #: These get an item when the gateway is open, and when it is closed (``_over``). They are no Future: Ctrl-C in
        #: the middle of waiting for one can leave its lock taken, for which this thread would then wait for ever; and
        #: in the middle of ``is_alive`` or ``join`` it makes Python take this thread for ended.
        self._opened, self._closed = SimpleQueue[None](), SimpleQueue[None]()
        self._over = False
        self._served = False
        self._failure: BaseException | None = None

    def run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            # Python 3.12 begins no thread at its end, and asyncio wants one to end its own: everything is closed then.
            self._failure = None if self._served else error
        self._over = True
        self._closed.put(None)

    async def _serve(self) -> None:
        serving = asyncio.current_task()
        assert serving is not None
        self._leave = serving.cancel
        self._loop = asyncio.get_running_loop()
        with contextlib.suppress(asyncio.CancelledError):
            if not self._asked:
                async with self._opening as self.gateway:
                    self._opened.put(None)
                    await asyncio.Event().wait()
        self._served = True

    def wait_until_open(self) -> None:
        """Wait until the gateway is open. Raises what opening it raises."""
        try:
            self._get(self._opened)
        except NoAnswer:
            failure, self._failure = self._failure, None
            raise failure or NoAnswer(CLOSED) from None

    def _get(self, queue: SimpleQueue[_T]) -> _T:
        """Wait for an item in such a way that Ctrl-C ends the wait on every system. Raises NoAnswer."""
        while not (self._over and queue.empty()):
            with contextlib.suppress(Empty):
                return queue.get(timeout=LOOK)
        raise NoAnswer(CLOSED)

    def result(self, call: Callable[[RunningGateway], Coroutine[object, object, _T]]) -> _T:
        """Carry out a call on the thread, wait for it, and return its result. Raises what it raises."""
        if threading.current_thread() is self:
            raise RuntimeError("A gateway that waits cannot be used on its own thread, by watch or warn.")
        if self._asked:
            raise NoAnswer(CLOSED)
        calling: list[asyncio.Task[_T]] = []
        answers = SimpleQueue[asyncio.Task[_T]]()

        async def called() -> _T:
            return await call(self.gateway)

        def begin() -> None:
            calling.append(self._loop.create_task(called()))
            calling[0].add_done_callback(answers.put)

        try:
            self._call(begin)
            return self._get(answers).result()
        except asyncio.CancelledError:  # another thread has left the block meanwhile
            raise NoAnswer(CLOSED) from None
        finally:
            self._call(lambda: [task.cancel() for task in calling])

    def _call(self, function: Callable[[], object]) -> None:
        """Call a function on the thread, unless its loop is closed."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function)

    def end(self) -> None:
        """Stop the mount, close the gateway, and wait until that is done. Raises what closing raises."""
        first, self._asked = not self._asked, True
        if first and hasattr(self, "_loop"):
            self._call(self._leave)
        while not self._over:
            with contextlib.suppress(Empty):
                self._closed.get(timeout=LOOK)
        if first:  # not when Python takes itself apart, after the end of the program
            self.join()
            atexit.unregister(self.end)
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure


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
                thread.wait_until_open()
            except UserError as error:
                raise UserError(str(error).replace("open_gateway:", "open_blocking_gateway:", 1)) from None
            yield BlockingGateway(thread)
        finally:
            thread.end()

    return open_blocking_gateway


open_blocking_gateway = _in_a_thread(open_gateway)
shown(open_blocking_gateway, "AbstractContextManager[BlockingGateway]")
