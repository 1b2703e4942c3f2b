"""Replaying a recording turn by turn: what came from outside comes again at the turn and the time at which it came.

The gateway is put together as it was and runs on a loop whose time is that of the recording. Nothing of it is guided:
what it asks the mount and tells its clients is compared with what it asked and told then. The recording is read as it
is wanted, and of what was said only that is kept which still waits for its other half.
"""

from __future__ import annotations

import asyncio
import re
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from gateway.assembly import Gateway
from gateway.entrance import Entrance
from gateway.errors import UserError
from gateway.line import Line
from gateway.ports import Guest
from gateway.recording import MOUNT, RECORDER, Event, Recording
from gateway.transcript import SKY_READY
from gateway.turns import BASE, TurnLoop, Wait
from gateway.wires import OnData, OnLost

#: What the gateway is given to end after the last turn, seconds.
AFTERWARDS = 1.0
#: Differences that are told of.
TOLD = 1000
#: What a connection was told in one piece, as far as it is shown.
SHOWN = 24


class Turn(NamedTuple):
    """What entered at the beginning of a turn and what was said until the next one with an entry, in that order."""

    number: int
    at: float
    events: list[Event]


def turns(recording: Recording) -> Iterator[Turn]:
    """A recording, turn by turn. Raises UserError."""
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
    """Whether this came from outside."""
    return event.arrow in ("<lgbsqk!" if event.side == MOUNT else "+>-")


class RetracedLoop(TurnLoop):
    """Takes turns and times from a recording. Where nothing is ready it goes on to the next turn that it knows of."""

    def __init__(self) -> None:
        super().__init__(lambda: 0.0)
        self._turns: Iterator[Turn] = iter(())
        self._next: Turn | None = None
        self._play: Callable[[Event], None] = lambda event: None
        self._begin: Callable[[Turn], None] = lambda turn: None
        self._ended: asyncio.Future[None] | None = None

    async def follow(self, turns: Iterator[Turn], begin: Callable[[Turn], None],
                     play: Callable[[Event], None]) -> None:
        """Go through these turns, and return after the last: ``begin`` is told of each, ``play`` of what enters."""
        self._turns, self._begin, self._play = turns, begin, play
        self._ended = self.create_future()
        self._next = next(turns)
        self.turn = self._next.number - 1
        await self._ended

    def begin_turn(self, timeout: float | None, wait: Wait) -> list[Any]:
        self.turn += 1
        turn = self._next
        if turn is None:
            if timeout != 0:  # after the recording time goes on by itself, as fast as it can
                if timeout is None and self._ended is not None and self._ended.done():
                    raise RuntimeError("nothing will ever happen again")
                self.elapsed += timeout or 0.0
                self._finish()
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
        """The last turn has begun."""
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

    def _finish(self) -> None:
        if self._ended is not None and not self._ended.done():
            self._ended.set_result(None)


class RetracedEntrance(Entrance):
    """What the gateway waited for comes when it came."""

    def __init__(self) -> None:
        self._gates: dict[int, asyncio.Future[None]] = {}
        self._number, self._released = 0, False

    def waiting(self, work: Any) -> Any:
        return self.passed

    async def passed(self) -> None:
        """Wait for something outside. Raises OSError when it failed then."""
        if self._released:
            return
        self._number += 1
        gate = self._gates[self._number] = asyncio.get_running_loop().create_future()
        await gate

    def release(self) -> None:
        """Nothing is waited for any more."""
        self._released = True
        for gate in self._gates.values():
            if not gate.done():
                gate.set_result(None)

    def open(self, event: Event) -> None:
        """That came."""
        number, _, failure = event.data.decode("latin-1").partition(" ")
        gate = self._gates.pop(int(number) if number.isdigit() else 0, None)
        if gate is not None and not gate.done():
            if failure:
                gate.set_exception(OSError(failure))
            else:
                gate.set_result(None)


class RetracedWire:
    """The mount as it was recorded."""

    name = "recording"

    def __init__(self, entrance: RetracedEntrance, now: Callable[[], float]) -> None:
        self._entrance, self._now = entrance, now
        self.on_data: OnData = lambda data: None
        self.on_lost: OnLost = lambda reason: None
        #: Requests of the recording that have not been made again yet, with the reason where one could not be written.
        self.script: deque[tuple[bytes, str | None]] = deque()
        self.strayed: list[str] = []
        self.requests = 0
        self.ended = False
        #: Whether the recording has been read to its end: what is asked after that is asked of nobody.
        self.over: Callable[[], bool] = lambda: False

    async def open(self, on_data: OnData, on_lost: OnLost) -> None:
        self.on_data, self.on_lost = on_data, on_lost
        await self._entrance.passed()

    def write(self, data: bytes) -> None:
        if self.ended:
            return
        if not self.script and self.over():
            return
        wanted, failure = self.script.popleft() if self.script else (b"", None)
        if data != wanted and len(self.strayed) < TOLD:
            self.strayed.append(f"{self._now():.3f} s: asked {data!r}, then {wanted!r}")
        if failure is not None:
            raise OSError(failure)

    def then(self, event: Event) -> None:
        """What was asked then."""
        if event.arrow == ">":
            self.requests += 1
            self.script.append((event.data, None))
        elif event.arrow == "w" and self.script:
            self.script.append((self.script.pop()[0], event.data.decode("latin-1")))

    async def close(self) -> None:
        if not self.ended:
            await self._entrance.passed()


class Difference(NamedTuple):
    """The first byte at which a client was told something else: what it received then, and now."""

    client: str
    at: float
    then: bytes
    now: bytes


class _Talk:
    """One connection: what it was told then and is told now, as far as they have not been compared."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.guest: Guest | None = None
        self.then, self.now = bytearray(), bytearray()
        self.at = 0.0
        self.difference: Difference | None = None

    def compare(self, less: bool = False, more: bool = False) -> None:
        """Forget what is alike; once something is not, or ``less`` or ``more`` is told by the end, remember that."""
        common = min(len(self.then), len(self.now))
        if self.difference is None:
            left = (less and len(self.then) > common) or (more and len(self.now) > common)
            if left or self.then[:common] != self.now[:common]:
                self.difference = Difference(self.name, self.at, bytes(self.then[:SHOWN]), bytes(self.now[:SHOWN]))
            del self.then[:common], self.now[:common]
        if self.difference is not None:
            self.then.clear()
            self.now.clear()


class Retracing:
    """A recording that is played again to ``gateway``, which is not put together yet."""

    def __init__(self, gateway: Gateway, loop: RetracedLoop) -> None:
        self.gateway, self._loop = gateway, loop
        self.entrance = RetracedEntrance()
        self.wire = RetracedWire(self.entrance, lambda: loop.elapsed)
        self.clients = self.replies = 0
        self.differences: list[Difference] = []
        self._here: dict[str, _Talk] = {}
        #: The connections as the recording goes on, which is ahead of what has been played of it.
        self._there: dict[str, _Talk] = {}
        self._coming: deque[_Talk] = deque()
        self._touched: list[_Talk] = []
        self._left: list[_Talk] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._host = float("nan")
        self.wire.over = lambda: loop.over
        gateway.clock = self.clock
        gateway.entrance = self.entrance

    def clock(self) -> float:
        """The host's clock, as it was."""
        return self._host + self._loop.time() - BASE

    async def run(self, recording: Recording) -> None:
        """Play it to its end, or as far as it goes. Raises UserError."""
        self._host = float(recording.settings["began"])
        self._loop.elapsed = float(recording.settings.get("elapsed", 0.0))
        self.gateway.prepare(lambda dialogue, transcript: Line(self.wire, dialogue, transcript))
        try:
            await self._loop.follow(turns(recording), self._begin, self._play)
            self._compare()
            for talk in self._here.values():
                talk.compare(less=True)
                self._settle(talk)
        finally:
            await self._end()

    async def _end(self) -> None:
        """Nobody is there any more, neither the mount nor what the gateway waits for."""
        self.wire.ended = True
        self.entrance.release()
        await asyncio.sleep(AFTERWARDS)
        assert self.gateway.hub is not None
        if not self.gateway.hub.closed:
            await self.gateway.hub.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # --- turn by turn -----------------------------------------------------------------------------------------------

    def _begin(self, turn: Turn) -> None:
        """A turn of the recording begins: what was said until now must have been said again."""
        self._compare()
        for event in turn.events:
            if event.side == MOUNT:
                self.wire.then(event)
            elif event.arrow == "+":
                self._there[event.side] = _Talk(event.side)
                self._coming.append(self._there[event.side])
            elif event.arrow == "-":
                self._there.pop(event.side, None)  # what comes for it later goes nowhere
            elif event.arrow == "<" and event.side in self._there:
                talk = self._there[event.side]
                talk.then += event.data
                talk.at = event.at
                self.replies += 1
                self._touched.append(talk)

    def _compare(self) -> None:
        for talk in self._touched:
            talk.compare()
        self._touched.clear()
        for talk in self._left:
            talk.compare(less=True, more=True)
            self._settle(talk)
        self._left.clear()

    def _settle(self, talk: _Talk) -> None:
        if talk.difference is not None and len(self.differences) < TOLD:
            self.differences.append(talk.difference)

    def _play(self, event: Event) -> None:
        """Make what came from outside come again."""
        if event.side == MOUNT:
            self._mount(event)
        elif event.arrow == "+":
            self._come(event)
        elif event.side in self._here:
            talk = self._here[event.side]
            assert talk.guest is not None
            if event.arrow == ">":
                talk.guest.feed(event.data)
            else:
                del self._here[event.side]
                talk.guest.close()
                self._left.append(talk)

    def _mount(self, event: Event) -> None:
        gateway = self.gateway
        assert gateway.hub is not None
        match event.arrow:
            case "<":
                self.wire.on_data(event.data)
            case "l":
                self.wire.on_lost(event.data.decode("latin-1"))
            case "g":
                self.entrance.open(event)
            case "b":
                gateway.begin()
            case "s":
                self._tasks.append(self._loop.create_task(gateway.hub.stop()))
            case "q":
                self._tasks.append(self._loop.create_task(gateway.hub.close()))
            case "k":
                self._host = float(event.data)
            case "!" if event.data == SKY_READY.encode():
                gateway.sky.load()

    def _come(self, event: Event) -> None:
        talk = self._coming.popleft()
        number, host = surface_and_host(event)
        reception = self.gateway.receptions[number - 1]
        name = host.removeprefix("pty:")
        talk.guest = reception.come(name if name.replace(" ", "_") == talk.name else talk.name, host, talk.now.extend)
        self._here[talk.name] = talk
        self.clients += 1


def surface_and_host(event: Event) -> tuple[int, str]:
    """Where a connection came in, and from which host. Raises UserError."""
    found = re.fullmatch(r"surface (\d+), host (.*)", event.data.decode("latin-1"))
    if found is None:
        raise UserError(f"recording, {event.at:.6f} s: a connection without its surface and host")
    return int(found.group(1)), found.group(2)
