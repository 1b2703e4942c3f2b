"""What the broker asks of a mount: an order like any person's, with the same limits, the same order, the same refusals.

A stop waits for no other order. What lay on the broker before (the retain flag) is obeyed by nobody: it would be
carried out again at every connection.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection

from gateway.app.config.checks import EVERY
from gateway.app.control import commands
from gateway.app.control.exchange import draw
from gateway.app.gateway import Gateway
from gateway.console import actions
from gateway.console.places import find
from gateway.core.errors import UserError
from gateway.core.waiting import BackgroundTasks

WHO = "mqtt"
#: Characters of an order; seconds between two stops on the line, however many are asked for.
LONGEST, BETWEEN = 100, 0.25
#: What is understood, beside stop.
PLAIN: dict[str, type[commands.Park | commands.Unpark | commands.Home]] = {
    "park": commands.Park,
    "wake": commands.Unpark,
    "home": commands.Home,
}
GOTO = "goto"

#: Told of what has become of an order: what kind of end, and words.
Tell = Callable[[str, str], None]


class Orders:
    """Of one mount. ``allowed`` are those that the configuration allows; ``doubt`` says why only stops are obeyed."""

    def __init__(self, gateway: Gateway, allowed: Collection[str], doubt: Callable[[], str], tell: Tell) -> None:
        self._gateway, self._allowed, self._doubt, self._tell = gateway, allowed, doubt, tell
        self._loop = asyncio.get_running_loop()
        self._last_stop = -1e9
        self._later: asyncio.TimerHandle | None = None
        self._tasks = BackgroundTasks()
        self._busy = False

    def take(self, payload: bytes, retained: bool, to: str) -> None:
        """An order has come, to this mount or to ``all``."""
        text = payload[: LONGEST + 1].decode("utf-8", "replace").strip()
        if not text and retained:
            return
        word, _, rest = text.partition(" ")
        if retained:
            self._refuse(text, "it has the retain flag, and is not obeyed: publish orders without it")
        elif text == "stop":
            self._stop()
        elif len(text) > LONGEST:
            self._refuse(f"{text[:20]}…", f"no order is longer than {LONGEST} characters")
        elif to == EVERY:
            self._refuse(text, "all mounts together can be told stop, and nothing else")
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
        """Nothing is obeyed any more."""
        if self._later is not None:
            self._later.cancel()
        self._tasks.cancel()

    def _refuse(self, text: str, why: str) -> None:
        self._gateway.wire_log.refused(WHO, f"{text}: {why}")

    def _stop(self) -> None:
        """At once; of many that come together the first one, and one more when they are over."""
        left = self._last_stop + BETWEEN - self._loop.time()
        if left <= 0:
            self._stop_now()
        elif self._later is None:
            self._later = self._loop.call_later(left, self._stop_now)

    def _stop_now(self) -> None:
        self._later, self._last_stop = None, self._loop.time()
        self._tasks.spawn(self._stopped())

    async def _stopped(self) -> None:
        done, words = await actions.order(self._gateway, "stop")
        self._tell("done" if done else "failed", f"stop: {words}")

    async def _carry_out(self, text: str, word: str, rest: str) -> None:
        self._busy = True
        try:
            number = draw()
            wish = commands.Goto(number, await find(rest), who=WHO) if word == GOTO else PLAIN[word](number, who=WHO)
            done, words = await actions.carry_out(self._gateway, wish)
        except UserError as error:
            done, words = False, str(error)
        finally:
            self._busy = False
        self._tell("done" if done else "failed", f"{text}: {words}")
