"""The terminal of ``prove``: narrow lines, a progress bar, and questions that one key answers."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import textwrap
from collections.abc import Iterator

from gateway.cli.serve.live import Screen

#: Columns of a line, and of the progress bar in it.
COLUMNS, BAR = 60, 14
#: Seconds between two looks at the keyboard, where the event loop cannot wait for it.
EVERY = 0.05


class Terminal(Screen):
    """The person at the terminal: prints narrow lines, also those of the gateway, and reads one key at a time."""

    def __init__(self) -> None:
        super().__init__(None)
        self.stop = asyncio.Event()
        self._keys: asyncio.Queue[str] = asyncio.Queue()
        self._bar, self._asks = 0, False
        #: Whether q was pressed in a stage, or left the last questions.
        self._left = False

    @contextlib.contextmanager
    def open(self) -> Iterator[Terminal]:
        """Read single keys while the block lasts."""
        self.stop, self._keys = asyncio.Event(), asyncio.Queue()  # of this event loop
        if sys.platform == "win32":
            poll = asyncio.ensure_future(self._poll())
            try:
                yield self
            finally:
                poll.cancel()
            return
        import termios
        import tty

        loop, number = asyncio.get_running_loop(), sys.stdin.fileno()
        before = termios.tcgetattr(number)
        tty.setcbreak(number)
        loop.add_reader(number, self._read)
        try:
            yield self
        finally:
            loop.remove_reader(number)
            with contextlib.suppress(termios.error):  # the terminal was closed
                termios.tcsetattr(number, termios.TCSADRAIN, before)

    def _read(self) -> None:
        import os

        try:
            text = os.read(sys.stdin.fileno(), 64).decode("ascii", "ignore")
        except OSError:
            text = ""
        if not text:  # the terminal is gone; SIGHUP ends the process
            asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
        for key in text:
            self.pressed(key)

    async def _poll(self) -> None:
        import msvcrt

        while True:
            while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
                self.pressed(msvcrt.getwch())  # type: ignore[attr-defined,unused-ignore]
            await asyncio.sleep(EVERY)

    def pressed(self, key: str) -> None:
        leaves = key in "qQ" and not self._asks
        self._left |= leaves
        if key == " " or leaves:  # whoever wants to leave in the middle wants it to stop
            self.stop.set()
        self._keys.put_nowait(key.lower())

    def say(self, text: str) -> None:
        """Print lines of at most 60 columns."""
        indent = " " * (len(text) - len(text.lstrip()))
        self._print("\n".join(textwrap.wrap(text, COLUMNS, subsequent_indent=f"{indent}  ")) + "\n")

    warn = say

    def progress(self, part: float, what: str) -> None:
        """Show how far the stage has come, below the last line."""
        done = round(BAR * part)
        line = f"[{'#' * done}{'.' * (BAR - done)}] {what}"[: COLUMNS - 1]
        self._print(f"{line}\r")
        self._bar = len(line)

    def _print(self, text: str) -> None:
        """Print below a question, or over a progress bar; a terminal that is gone must not keep a mount moving."""
        before = " " * self._bar + "\r" if self._bar else "\n" * self._asks
        self._bar, self._asks = 0, False
        with contextlib.suppress(OSError, ValueError):
            print(before + text, end="", flush=True)

    async def key(self, question: str, keys: str) -> str:
        """Return one of these keys, or the space bar; what was pressed before the question does not count, but that,
        and q after it. Any other key repeats the question."""
        while not self._keys.empty():
            self._keys.get_nowait()
        while not self.stop.is_set():
            if self._left:
                self._left = False
                return "q"
            self._print(f"{textwrap.fill(question, COLUMNS - 4)} > ")
            self._asks = True
            if (key := await self._keys.get()) in keys:
                self._asks = False
                self._print(f"{key}\n")
                return key
        return " "

    async def agrees(self, question: str) -> bool:
        """Return whether the answer is y, where nothing moves that the space bar could stop; after q none is asked."""
        key = "q" if self._left else " "
        while key == " ":
            self.stop.clear()
            key = await self.key(question, "ynq")
        self._left = key == "q"
        return key == "y"
