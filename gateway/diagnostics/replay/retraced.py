"""The replacements of the outside world in a replay: loop, clock, mount and other inputs, all as recorded."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from gateway.app.recording.entrance import Entrance
from gateway.app.recording.format import RECORDER, Event, Recording
from gateway.app.recording.turns import TurnLoop, Wait
from gateway.core.errors import UserError
from gateway.core.wire_log import MOUNT, show
from gateway.mount.motion.reconciler import Announce
from gateway.transport.wires import OnData, OnLost

#: How many differing requests are reported.
TOLD = 1000


class Turn(NamedTuple):
    """The inputs at the beginning of a turn, followed by the outputs until the next turn with an input."""

    number: int
    at: float
    events: list[Event]


def turns(recording: Recording) -> Iterator[Turn]:
    """Yield a recording turn by turn. Raises UserError."""
    turn = Turn(0, 0.0, [])
    for event in recording:
        if event.arrow == "t":
            yield turn
            number = int(event.data) if event.data.isdigit() else 0
            if number <= turn.number or event.at < turn.at:
                raise UserError(f"recording, {event.at:.6f} s: its turns are not in their order")
            turn = Turn(number, event.at, [])
        elif event.side != RECORDER:
            turn.events.append(event)
    yield turn


def entered(event: Event) -> bool:
    """Whether this event is an input from outside."""
    return event.arrow in ("<lgbsqdohuc!" if event.side == MOUNT else "+>-e")


class RetracedLoop(TurnLoop):
    """Takes turns and times from a recording. If nothing is ready, it advances to the next recorded turn."""

    def __init__(self) -> None:
        super().__init__(lambda: 0.0)
        self._turns: Iterator[Turn] = iter(())
        self._next: Turn | None = None
        self._play: Callable[[Event], None] = lambda event: None
        self._begin: Callable[[Turn], None] = lambda turn: None
        self._ended: asyncio.Future[None] | None = None

    async def follow(self, turns: Iterator[Turn], begin: Callable[[Turn], None], play: Callable[[Event], None]) -> None:
        """Follow these turns to the last one; call ``begin`` with each turn and ``play`` with each of its inputs."""
        self._turns, self._begin, self._play = turns, begin, play
        self._ended = self.create_future()
        self._next = next(turns)
        self.turn = self._next.number - 1
        await self._ended

    def begin_turn(self, timeout: float | None, wait: Wait) -> list[object]:
        self.turn += 1
        turn = self._next
        if turn is None:
            if timeout != 0:  # after the end of the recording, time advances as fast as possible
                if timeout is None and self._ended is not None and self._ended.done():
                    raise RuntimeError("nothing will ever happen again")
                self.elapsed += timeout or 0.0
                if self._ended is not None and not self._ended.done():
                    self._ended.set_result(None)
            return []
        if timeout != 0:
            self.turn = turn.number
        if self.turn >= turn.number:
            self.elapsed = turn.at
            try:
                self._begin(turn)
                self._next = next(self._turns, None)
            except Exception as error:
                self._fail(error)
                return []
            for event in filter(entered, turn.events):
                self.call_soon(self._enter, event)
        return []

    @property
    def over(self) -> bool:
        return self._next is None

    def _enter(self, event: Event) -> None:
        try:
            self._play(event)
        except UserError as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        self._next = None
        if self._ended is not None and not self._ended.done():
            self._ended.set_exception(error)


class RetracedEntrance(Entrance):
    """Ends each wait of the gateway for the outside at its recorded turn."""

    def __init__(self) -> None:
        self._gates: dict[int, asyncio.Future[None]] = {}
        self._number, self._released = 0, False

    def announcers(self, announcers: Sequence[Announce]) -> Sequence[Announce]:
        return [self.wait_outside]

    async def wait_outside(self) -> None:
        """Wait for something outside. Raises OSError if it failed when it was recorded."""
        if self._released:
            return
        self._number += 1
        gate = self._gates[self._number] = asyncio.get_running_loop().create_future()
        await gate

    def release(self) -> None:
        """End all waits, now and in future."""
        self._released = True
        for gate in self._gates.values():
            if not gate.done():
                gate.set_result(None)

    def open(self, event: Event) -> None:
        """End the wait that this event belongs to."""
        number, _, failure = event.data.decode("latin-1").partition(" ")
        gate = self._gates.pop(int(number) if number.isdigit() else 0, None)
        if gate is not None and not gate.done():
            if failure:
                gate.set_exception(OSError(failure))
            else:
                gate.set_result(None)


class RetracedWire:
    name = "recording"

    def __init__(self, entrance: RetracedEntrance, now: Callable[[], float], newest_only: bool) -> None:
        self._entrance, self._now, self.newest_only = entrance, now, newest_only
        self.on_data: OnData = lambda data: None
        self.on_lost: OnLost = lambda reason: None
        #: Recorded requests that have not been repeated yet, with the reason if one could not be written.
        self.script: deque[tuple[bytes, str | None]] = deque()
        self.strayed: list[str] = []
        self.requests = 0
        self.ended = False
        #: Whether the recording has been read to its end; later requests are ignored.
        self.over: Callable[[], bool] = lambda: False

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self.on_data, self.on_lost = on_data, on_lost
        await self._entrance.wait_outside()

    def write(self, data: bytes) -> None:
        if self.ended:
            return
        if not self.script and self.over():
            return
        wanted, failure = self.script.popleft() if self.script else (b"", None)
        if data != wanted and len(self.strayed) < TOLD:
            self.strayed.append(f"{self._now():.3f} s: asked '{show(data)}', then '{show(wanted)}'")
        if failure is not None:
            raise OSError(failure)

    def then(self, event: Event) -> None:
        """Note a recorded request."""
        if event.arrow == ">":
            self.requests += 1
            self.script.append((event.data, None))
        elif event.arrow == "w" and self.script:
            self.script.append((self.script.pop()[0], event.data.decode("latin-1")))

    async def close(self) -> None:
        if not self.ended:
            await self._entrance.wait_outside()
