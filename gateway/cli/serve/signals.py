"""Handles the signals that end or suspend the process.

SIGINT, SIGTERM and closing the terminal end it after an orderly shutdown; a second Ctrl-C ends it at once. Windows
calls a console handler for a closed window instead, and gives the process 5 s. Ctrl-Z suspends it only after
the mount was stopped, because a suspended gateway cannot supervise a moving mount.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import time
from collections.abc import Awaitable, Callable, Coroutine
from typing import TypeVar

_T = TypeVar("_T")
#: Two SIGINTs within this time (seconds) count as one: a wrapper that passes Ctrl-C on delivers it twice.
DOUBLE_PRESS_TIME = 0.1
#: Windows' numbers of events: the terminal's window is closed, the user logs off, the computer shuts down.
WINDOWS_CLOSE_EVENTS = (2, 5, 6)
#: Seconds that the handler waits for the process to end: longer than the 5 s after which Windows ends it.
WINDOWS_EXIT_TIMEOUT = 10.0
#: References to the handlers that Windows calls: ctypes does not keep them alive.
_WINDOWS_HANDLERS: list[object] = []


def end_signal_event() -> asyncio.Event:
    """Return an event that SIGINT, SIGTERM and closing the terminal set; a second Ctrl-C ends the process at once."""
    done = asyncio.Event()
    loop = asyncio.get_running_loop()
    first_signal_at = 0.0

    def on_end_signal(number: int) -> None:
        nonlocal first_signal_at
        if not done.is_set():
            done.set()
            first_signal_at = loop.time()
        elif number == signal.SIGINT and loop.time() - first_signal_at > DOUBLE_PRESS_TIME:
            os._exit(128 + number)

    numbers = [signal.SIGINT, signal.SIGTERM]
    if sys.platform == "win32":
        numbers.append(signal.SIGBREAK)
    elif signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # else it runs under nohup
        numbers.append(signal.SIGHUP)
    for number in numbers:
        try:
            loop.add_signal_handler(number, on_end_signal, number)
        except NotImplementedError:  # Windows
            signal.signal(number, lambda number, _: loop.call_soon_threadsafe(on_end_signal, number))
    if sys.platform == "win32":
        _call_on_window_close(lambda: loop.call_soon_threadsafe(on_end_signal, signal.SIGTERM))
    return done


def _call_on_window_close(on_close: Callable[[], object]) -> None:
    """On Windows, call ``on_close`` when the terminal's window closes, and let the process end by itself after that.

    Call it after the signals were set up: Windows calls the newest handler first. The handler of Python's C library
    takes a closed window for Ctrl-Break and returns at once, which would end the process.
    """
    import ctypes

    def on_console_event(event: int) -> bool:
        """Handle a console event. Windows calls this on a thread, and ends the process when it returns True."""
        if event not in WINDOWS_CLOSE_EVENTS:
            return False  # Ctrl-C and Ctrl-Break, which are signals
        with contextlib.suppress(RuntimeError):  # the loop is closed: the process is ending already
            on_close()
        time.sleep(WINDOWS_EXIT_TIMEOUT)
        return True

    handler = ctypes.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)(on_console_event)  # type: ignore[attr-defined,unused-ignore]
    _WINDOWS_HANDLERS.append(handler)
    kernel = ctypes.WinDLL("kernel32")  # type: ignore[attr-defined,unused-ignore]
    kernel.SetConsoleCtrlHandler(handler, True)


async def race(done: asyncio.Event, work: Awaitable[_T]) -> _T | None:
    """Return the result of ``work``, or raise its error; if ``done`` is set first, cancel ``work`` and return None."""
    working, end = asyncio.ensure_future(work), asyncio.ensure_future(done.wait())
    await asyncio.wait((working, end), return_when=asyncio.FIRST_COMPLETED)
    for future in (end, working):
        future.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        return await working
    return None


def call_before_suspension(prepare: Callable[[], Coroutine[object, object, None]]) -> None:
    """Make Ctrl-Z run ``prepare`` and then suspend the process; a second Ctrl-Z suspends it at once. Not on Windows."""
    if sys.platform == "win32" or signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN:
        return
    loop = asyncio.get_running_loop()
    preparing: asyncio.Task[None] | None = None

    async def suspend() -> None:
        try:
            await prepare()
        finally:
            os.kill(os.getpid(), signal.SIGSTOP)

    def on_suspend_signal() -> None:
        nonlocal preparing
        if preparing is None or preparing.done():
            preparing = loop.create_task(suspend())
        else:
            os.kill(os.getpid(), signal.SIGSTOP)

    loop.add_signal_handler(signal.SIGTSTP, on_suspend_signal)
