"""``BlockingMount``: the methods of ``Mount`` for programs without an event loop. Each method waits for its result.

The gateway runs on an event loop in a thread of its own, so it serves other programs while this one waits or
calculates. The signatures are derived from ``Mount``, for type checkers. Several threads may use one mount.
"""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import functools
import threading
from collections.abc import Callable, Coroutine, Iterator
from queue import Empty, SimpleQueue
from typing import Concatenate, ParamSpec, Protocol, TypeVar

from gateway.app.api.mount import Mount
from gateway.app.api.opening import connect, open_gateway
from gateway.core.errors import NoAnswer

_P = ParamSpec("_P")
_T = TypeVar("_T")
#: Seconds between two checks for Ctrl-C, which on Windows does not interrupt a wait without a timeout.
CTRL_C_CHECK_PERIOD = 0.2
CLOSED_MESSAGE = "The gateway is closed."


class CoroutineRunner(Protocol):
    """Makes and begins a coroutine, waits for it, and returns its result."""

    def __call__(self, make_coroutine: Callable[[], Coroutine[object, object, _T]], /) -> _T: ...


def _make_blocking(
    method: Callable[Concatenate[Mount, _P], Coroutine[object, object, _T]],
) -> Callable[Concatenate[BlockingMount, _P], _T]:
    """Return a method for ``BlockingMount`` that calls this method of ``Mount`` and waits for the result."""

    @functools.wraps(method)
    def wait_for_result(self: BlockingMount, /, *arguments: _P.args, **named: _P.kwargs) -> _T:
        return self._run_coroutine(lambda: method(self._mount, *arguments, **named))

    return wait_for_result


class BlockingMount:
    """``Mount`` with methods that wait for their results; made by ``open_blocking_gateway`` and ``connect_blocking``.

    Ctrl-C ends the wait. The mount is stopped if Ctrl-C also ends the ``with`` block of ``open_blocking_gateway``.
    """

    def __init__(self, mount: Mount, run_coroutine: CoroutineRunner) -> None:
        self._mount, self._run_coroutine, self.name = mount, run_coroutine, mount.name

    ready = _make_blocking(Mount.ready)
    addresses = _make_blocking(Mount.addresses)
    status = _make_blocking(Mount.status)
    position = _make_blocking(Mount.position)
    moving = _make_blocking(Mount.moving)
    site = _make_blocking(Mount.site)
    time = _make_blocking(Mount.time)
    goto = _make_blocking(Mount.goto)
    goto_object = _make_blocking(Mount.goto_object)
    park = _make_blocking(Mount.park)
    unpark = _make_blocking(Mount.unpark)
    arrived = _make_blocking(Mount.arrived)
    sync = _make_blocking(Mount.sync)
    move = _make_blocking(Mount.move)
    stop = _make_blocking(Mount.stop)
    hold = _make_blocking(Mount.hold)
    release = _make_blocking(Mount.release)
    perform = _make_blocking(Mount.perform)


class _GatewayThread(threading.Thread):
    """Runs an event loop with one open gateway until ``end`` is called, at the latest by ``atexit``. It is a daemon
    thread: Python waits for every thread but daemons before ``atexit``, so otherwise the program would never end.
    """

    mount: Mount

    def __init__(self, gateway_context: contextlib.AbstractAsyncContextManager[Mount]) -> None:
        super().__init__(name="mount-gateway", daemon=True)
        self._gateway_context, self._close_requested = gateway_context, False
        #: These queues get an item when the gateway is open, and when it is closed. A Future would not do: Ctrl-C
        #: during a wait can leave its lock locked, and this thread would wait for that lock for ever. ``is_alive`` and
        #: ``join`` would not do either: interrupted by Ctrl-C, they may report that the thread has ended.
        self._opened_queue, self._closed_queue = SimpleQueue[None](), SimpleQueue[None]()
        self._ended = False
        self._was_open = False
        self._open_error: BaseException | None = None

    def run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            # Python 3.12 begins no thread at its end, and asyncio wants one to end its own: everything is closed then.
            self._open_error = None if self._was_open else error
        self._ended = True
        self._closed_queue.put(None)

    async def _serve(self) -> None:
        serving = asyncio.current_task()
        assert serving is not None
        self._cancel_serving = serving.cancel
        self._loop = asyncio.get_running_loop()
        with contextlib.suppress(asyncio.CancelledError):
            if not self._close_requested:
                async with self._gateway_context as self.mount:
                    self._opened_queue.put(None)
                    await asyncio.Event().wait()
        self._was_open = True

    def wait_until_open(self) -> None:
        """Wait until the gateway is open. Raises what opening it raises."""
        try:
            self._wait_for_item(self._opened_queue)
        except NoAnswer:
            failure, self._open_error = self._open_error, None
            raise failure or NoAnswer(CLOSED_MESSAGE) from None

    def _wait_for_item(self, queue: SimpleQueue[_T]) -> _T:
        """Wait for an item; Ctrl-C ends the wait on every system. Raises NoAnswer once the thread has ended."""
        while not (self._ended and queue.empty()):
            with contextlib.suppress(Empty):
                return queue.get(timeout=CTRL_C_CHECK_PERIOD)
        raise NoAnswer(CLOSED_MESSAGE)

    def run_coroutine(self, make_coroutine: Callable[[], Coroutine[object, object, _T]]) -> _T:
        """Run a coroutine on the thread; return its result. Raises its error, and NoAnswer if the gateway is closed."""
        if threading.current_thread() is self:
            raise RuntimeError("A gateway that waits cannot be used on its own thread, by watch or warn.")
        if self._close_requested:
            raise NoAnswer(CLOSED_MESSAGE)
        calling: list[asyncio.Task[_T]] = []
        answers = SimpleQueue[asyncio.Task[_T]]()

        def start() -> None:
            calling.append(self._loop.create_task(make_coroutine()))
            calling[0].add_done_callback(answers.put)

        try:
            self._call(start)
            return self._wait_for_item(answers).result()
        except asyncio.CancelledError:  # another thread has left the block meanwhile
            raise NoAnswer(CLOSED_MESSAGE) from None
        finally:
            self._call(lambda: [task.cancel() for task in calling])

    def _call(self, function: Callable[[], object]) -> None:
        """Call a function on the thread, unless its loop is closed."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function)

    def end(self) -> None:
        """Stop the mount, close the gateway, and wait until that is done. Raises what closing raises."""
        first, self._close_requested = not self._close_requested, True
        if first and hasattr(self, "_loop"):
            self._call(self._cancel_serving)
        while not self._ended:
            with contextlib.suppress(Empty):
                self._closed_queue.get(timeout=CTRL_C_CHECK_PERIOD)
        if first:  # not when Python takes itself apart, after the end of the program
            self.join()
            atexit.unregister(self.end)
        failure, self._open_error = self._open_error, None
        if failure is not None:
            raise failure


def _make_blocking_opener(
    open_mount: Callable[_P, contextlib.AbstractAsyncContextManager[Mount]],
) -> Callable[_P, contextlib.AbstractContextManager[BlockingMount]]:
    """Return a version of ``open_gateway``, with the same parameters, for programs without an event loop."""

    @functools.wraps(open_mount, assigned=())
    @contextlib.contextmanager
    def open_blocking_gateway(*arguments: _P.args, **settings: _P.kwargs) -> Iterator[BlockingMount]:
        """Open a mount as ``open_gateway`` does, for a program without an event loop: ``with``, not ``async with``.

        ``warn`` and ``watch`` are called on the gateway's thread. Leaving the block, or ending the program inside it,
        stops the mount and closes everything.
        """
        thread = _GatewayThread(open_mount(*arguments, **settings))
        thread.start()
        atexit.register(thread.end)
        try:
            thread.wait_until_open()
            yield BlockingMount(thread.mount, thread.run_coroutine)
        finally:
            thread.end()

    return open_blocking_gateway


open_blocking_gateway = _make_blocking_opener(open_gateway)


def connect_blocking(mount: str | None = None, *, state: str | None = None) -> BlockingMount:
    """Find a gateway as ``connect`` does, for a program without an event loop."""
    return BlockingMount(connect(mount, state=state), lambda begin: asyncio.run(begin()))
