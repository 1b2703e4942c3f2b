"""Carries out orders that reach a mount through the broker, under the same limits and rules as those of any user.

A stop does not wait for other orders. An order with the retain flag is refused: the broker stores it, and it would be
carried out again at every connection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection

from gateway.app.config.checks import ALL
from gateway.app.gateway import Gateway
from gateway.core.requests import Goto, Home, Named, Park, Stop, Unpark
from gateway.core.waiting import BackgroundTasks
from gateway.fleet.client import LARGEST

WHO = "mqtt"
#: Maximum length of an order in characters; minimum seconds between two stops that are sent to the mount.
LONGEST, BETWEEN = 100, 0.25
#: The orders of one word, besides stop.
PLAIN: dict[str, type[Park | Unpark | Home]] = {"park": Park, "wake": Unpark, "home": Home}
GOTO = "goto"

#: Called with the result of an order: ``done`` or ``failed``, and words.
Report = Callable[[str, str], None]


class Orders:
    """The orders for one mount, of the ``allowed`` kinds. ``doubt`` returns why only stops are obeyed now, or ""."""

    def __init__(self, gateway: Gateway, allowed: Collection[str], doubt: Callable[[], str], report: Report) -> None:
        self._gateway, self._allowed, self._doubt, self._report = gateway, allowed, doubt, report
        self._loop = asyncio.get_running_loop()
        self._last_stop = -1e9
        self._later: asyncio.TimerHandle | None = None
        self._tasks = BackgroundTasks()
        self._busy = False

    def take(self, payload: bytes, retained: bool, to: str) -> None:
        """Carry out or refuse an order; ``to`` is the mount's name, or ``all``."""
        text = payload[: LONGEST + 1].decode("utf-8", "replace").strip()
        if not text and retained:
            return
        word, _, rest = text.partition(" ")
        if retained:
            self._refuse(text, "it has the retain flag, and is not obeyed: publish orders without it")
        elif text == "stop":
            self._stop()
        elif len(text) > LONGEST:
            once = WHO if len(payload) > LARGEST else None
            self._refuse(f"{text[:20]}…", f"no order is longer than {LONGEST} characters", once)
        elif to == ALL:
            self._refuse(text, "the only order for all mounts together is stop")
        elif word not in (*PLAIN, GOTO) or (bool(rest) is not (word == GOTO)):
            self._refuse(text, f"there is no such order: {', '.join(('stop', *self._allowed))}")
        elif word not in self._allowed:
            self._refuse(text, f'the broker may not ask for this; orders = ["{word}"] under [mqtt] allows it')
        elif words := self._doubt():
            self._refuse(text, words)
        elif self._busy:
            self._refuse(text, "another order is being taken; send it again in a moment")
        else:
            self._tasks.spawn(self._carry_out(text, word, rest))

    def close(self) -> None:
        """Cancel the orders in progress; later ones must not be passed to ``take``."""
        if self._later is not None:
            self._later.cancel()
        self._tasks.cancel()

    def _refuse(self, text: str, why: str, once_of: str | None = None) -> None:
        self._gateway.wire_log.refused(WHO, f"{text}: {why}", once_of)

    def _stop(self) -> None:
        """Stop at once, or, after a recent stop, once more when ``BETWEEN`` seconds have passed since that."""
        left = self._last_stop + BETWEEN - self._loop.time()
        if left <= 0:
            self._stop_now()
        elif self._later is None:
            self._later = self._loop.call_later(left, self._stop_now)

    def _stop_now(self) -> None:
        self._later, self._last_stop = None, self._loop.time()
        self._tasks.spawn(self._stopped())

    async def _stopped(self) -> None:
        answer = await self._gateway.request_handler.take(Stop())
        self._report(answer.outcome, f"stop: {answer.words}")

    async def _carry_out(self, text: str, word: str, rest: str) -> None:
        self._busy = True
        try:
            request = Goto(Named(rest), who=WHO) if word == GOTO else PLAIN[word](who=WHO)
            answer = await self._gateway.request_handler.take(request)
        finally:
            self._busy = False
        self._report(answer.outcome, f"{text}: {answer.words}")
