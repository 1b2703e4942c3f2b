"""Pages of the console over a slow network: the page's own scripts in Node, the gateway's page session, virtual time.

What a page sends arrives after the delay of the network and a random jitter, in order, and so do the answers. A network
can be frozen: then nothing arrives until it is thawed.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from random import Random
from typing import Any, Self

from gateway.console.mounts import Mounts
from gateway.console.page_session import PageSession
from tests.programs.processes import requires

SCRIPTS = Path(__file__).resolve().parents[3] / "gateway/console/page/js"


class Node:
    """The process that runs the scripts of all pages."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def ask(self, *question: Any) -> dict[str, Any]:
        process = self._process
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        process.stdin.write(json.dumps(question) + "\n")
        process.stdin.flush()
        told = process.stdout.readline()
        assert told, process.stderr.read()
        answer: dict[str, Any] = json.loads(told)
        return answer


@contextlib.contextmanager
def node() -> Iterator[Node]:
    requires("node")
    words = [
        "node",
        "--experimental-vm-modules",
        "--no-warnings",
        str(Path(__file__).with_name("pages.mjs")),
        str(SCRIPTS),
    ]
    pipe = subprocess.PIPE
    with subprocess.Popen(words, stdin=pipe, stdout=pipe, stderr=pipe, text=True, encoding="utf-8") as process:
        yield Node(process)
        process.communicate(timeout=60.0)


class Way:
    """One direction of a connection: delivers in order, each message after the delay and the jitter, seconds."""

    def __init__(self, delay: float, jitter: float, random: Random) -> None:
        self._delay, self._jitter, self._random = delay, jitter, random
        self._loop = asyncio.get_running_loop()
        self._last = 0.0
        self.frozen = self.cut = False
        self._kept: list[Callable[[], None]] = []
        #: The gateway's end, once the connection is accepted.
        self.session: PageSession | None = None

    def take(self, text: str) -> None:
        """Let the gateway's end receive a message."""
        assert self.session is not None
        self.session.receive(text)

    def send(self, arrives: Callable[[], None]) -> None:
        at = self._loop.time() + self._delay + self._random.random() * self._jitter
        self._last = max(at, self._last)
        self._loop.call_at(self._last, self._arrive, arrives)

    def _arrive(self, arrives: Callable[[], None]) -> None:
        if self.frozen:
            self._kept.append(arrives)
        elif not self.cut:
            arrives()


class Page:
    """A page in a browser, and its session at the gateway. ``words`` are the notices that it has shown."""

    def __init__(self, node: Node, number: int, mounts: Mounts, delay: float, jitter: float, random: Random) -> None:
        self._node, self._number, self._mounts = node, number, mounts
        self._network = delay, jitter, random
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._shown: asyncio.Task[None] | None = None
        self.words: list[str] = []
        #: The fingers on the page's arrows, by pointer.
        self.fingers: dict[int, str] = {}

    async def __aenter__(self) -> Self:
        self.load()
        return self

    async def __aexit__(self, *_: object) -> None:
        self.end()
        await asyncio.sleep(0.0)

    def load(self) -> None:
        """Load the page, or load it again; the connection of the one before is closed."""
        if self._shown is not None:
            self.do("leave")
            self.end()
        self.fingers.clear()
        self._up, self._down = Way(*self._network), Way(*self._network)
        self.do("load")
        up, down = self._up, self._down
        up.send(lambda: self._accepted(up, down))

    def end(self) -> None:
        """Close the connection; the gateway notices when that has arrived."""
        shown, down = self._shown, self._down
        down.cut = True
        if shown is not None:
            self._up.send(lambda: _cancel(shown))
            self._shown = None
        if self._timer is not None:
            self._timer.cancel()

    def freeze(self) -> None:
        """Nothing arrives in either direction any more, and neither end notices."""
        self._up.frozen = self._down.frozen = True

    def _accepted(self, up: Way, down: Way) -> None:
        session = PageSession(self._mounts, _Wire(self, down), "10.0.0.9", may_control=True)
        up.session = session
        if not down.cut:
            self._shown = asyncio.ensure_future(session.run())
            down.send(lambda: self.do("opened"))

    def do(self, *what: Any) -> None:
        """Let something happen to the page, and what is due there."""
        if self._timer is not None:
            self._timer.cancel()
        told = self._node.ask(self._number, self._loop.time() * 1000.0, *what)
        self.words += told["notices"]
        for text in told["sent"]:
            if text is not None:
                self._up.send(partial(self._up.take, text))
        if told["next"] is not None:
            self._timer = self._loop.call_at(max(told["next"] / 1000.0, self._loop.time() + 0.001), self.do, "wait")

    def hears(self, text: str) -> None:
        self.do("message", text)

    # --- the person -----------------------------------------------------------------------------------------------

    def press(self, direction: str, pointer: int = 1) -> None:
        self.fingers[pointer] = direction
        self.do("press", direction, pointer)

    def lift(self, pointer: int = 1) -> None:
        self.fingers.pop(pointer, None)
        self.do("release", pointer)

    def loses(self, what: str, *more: Any) -> None:
        """Lose the focus or the view: the page lets all arrows go."""
        self.fingers.clear()
        self.do(what, *more)


def _cancel(task: asyncio.Task[None]) -> None:
    task.cancel()


class _Wire:
    """The gateway's end of a page's connection."""

    def __init__(self, page: Page, down: Way) -> None:
        self._page, self._down = page, down

    def unread_byte_count(self) -> int:
        return 0

    async def send(self, text: str) -> None:
        self._down.send(lambda: self._page.hears(text))
