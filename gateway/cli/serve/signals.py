"""Signals: what ends the process, and what suspends it.

SIGINT, SIGTERM and the closing of the terminal end it in order; a second Ctrl-C ends it at once. Ctrl-Z suspends it
only after the mount was stopped: nobody looks after a mount that moves while its gateway is suspended.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Awaitable, Callable, Coroutine
from typing import TypeVar

_T = TypeVar("_T")
#: A wrapper that passes a Ctrl-C on delivers it twice within this time, in seconds; a person does not.
TWICE = 0.1


def until_signal() -> asyncio.Event:
    """An event that SIGINT, SIGTERM and the closing of the terminal set; a second Ctrl-C ends the process at once."""
    done = asyncio.Event()
    loop = asyncio.get_running_loop()
    asked = 0.0

    def end(number: int) -> None:
        nonlocal asked
        if not done.is_set():
            done.set()
            asked = loop.time()
        elif number == signal.SIGINT and loop.time() - asked > TWICE:
            os._exit(128 + number)

    numbers = [signal.SIGINT, signal.SIGTERM]
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # else it runs under nohup
        numbers.append(signal.SIGHUP)
    for number in numbers:
        try:
            loop.add_signal_handler(number, end, number)
        except NotImplementedError:  # Windows
            signal.signal(number, lambda number, _: loop.call_soon_threadsafe(end, number))
    return done


async def unless(done: asyncio.Event, work: Awaitable[_T]) -> _T | None:
    """What some work comes to; None when the end came first, which cancels it. Raises what the work raises."""
    working, end = asyncio.ensure_future(work), asyncio.ensure_future(done.wait())
    await asyncio.wait((working, end), return_when=asyncio.FIRST_COMPLETED)
    for future in (end, working):
        future.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        return await working
    return None


def before_suspension(prepare: Callable[[], Coroutine[object, object, None]]) -> None:
    """Have something done on Ctrl-Z before the process is suspended; a second one suspends it at once."""
    if sys.platform == "win32" or signal.getsignal(signal.SIGTSTP) is signal.SIG_IGN:
        return
    loop = asyncio.get_running_loop()
    preparing: asyncio.Task[None] | None = None

    async def suspend() -> None:
        try:
            await prepare()
        finally:
            os.kill(os.getpid(), signal.SIGSTOP)

    def asked() -> None:
        nonlocal preparing
        if preparing is None or preparing.done():
            preparing = loop.create_task(suspend())
        else:
            os.kill(os.getpid(), signal.SIGSTOP)

    loop.add_signal_handler(signal.SIGTSTP, asked)
