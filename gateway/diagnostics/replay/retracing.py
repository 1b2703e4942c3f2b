"""Replaying a recording turn by turn: what came from outside comes again at the turn and the time at which it came.

The gateway is put together as it was and runs on a loop whose time is that of the recording. Nothing of it is guided:
what it asks the mount and tells its clients is compared with what it asked and told then. The recording is read as it
is wanted, and of what was said only that is kept which still waits for its other half.
"""

from __future__ import annotations

import asyncio
from collections import deque

from gateway.app.control.orders import stopped
from gateway.app.gateway import Gateway
from gateway.app.recording.format import Event, Recording
from gateway.app.recording.turns import BASE
from gateway.core.wire_log import MOUNT, SKY_READY
from gateway.diagnostics.replay.retraced import TOLD, RetracedEntrance, RetracedLoop, RetracedWire, Turn, turns
from gateway.diagnostics.replay.told import Difference, Told, surface_and_host
from gateway.mount.link.line import MountLink

#: What the gateway is given to end after the last event, seconds.
AFTERWARDS = 1.0


class Retracing:
    """A recording that is played again to ``gateway``, which is not put together yet."""

    def __init__(self, gateway: Gateway, loop: RetracedLoop) -> None:
        self.gateway, self._loop = gateway, loop
        self.entrance = RetracedEntrance()
        self.wire = RetracedWire(self.entrance, lambda: loop.elapsed)
        self.clients = self.replies = 0
        self.differences: list[Difference] = []
        self._here: dict[str, Told] = {}
        #: The connections as the recording goes on, which is ahead of what has been played of it.
        self._there: dict[str, Told] = {}
        self._coming: deque[Told] = deque()
        self._touched: list[Told] = []
        self._left: list[Told] = []
        self._tasks: list[asyncio.Task[object]] = []
        self._host = float("nan")
        #: The recording goes on to where the gateway was told to end.
        self._closing = False
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
        self.gateway.prepare(lambda dialogue, wire_log: MountLink(self.wire, dialogue, wire_log))
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
        if not self._closing:
            await self.gateway.controller.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # --- turn by turn -----------------------------------------------------------------------------------------------

    def _begin(self, turn: Turn) -> None:
        """A turn of the recording begins: what was said until now must have been said again."""
        self._compare()
        for event in turn.events:
            if event.arrow == "k":
                self._host = float(event.data)  # from the beginning of this turn
            elif event.side == MOUNT:
                self.wire.then(event)
            elif event.arrow == "+":
                self._there[event.side] = Told(event.side)
                self._coming.append(self._there[event.side])
            elif event.arrow == "-":
                self._there.pop(event.side, None)  # what comes for it later goes nowhere
            elif event.arrow == "<" and event.side in self._there:
                talk = self._there[event.side]
                talk.was_told(event)
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

    def _settle(self, talk: Told) -> None:
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
            talk.play(event)
            if event.arrow not in ">e":
                self._left.append(self._here.pop(event.side))

    def _mount(self, event: Event) -> None:
        gateway = self.gateway
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
                self._tasks.append(self._loop.create_task(gateway.controller.stop()))
            case "o":
                self._tasks.append(self._loop.create_task(stopped(gateway.controller)))
            case "c":
                wish = gateway.desk.carry_out(event.data.decode("latin-1"))
                self._tasks.append(self._loop.create_task(wish))
            case "h" | "u":
                gateway.controller.hold.on = event.arrow == "h"
            case "d":
                gateway.was_stopped()
            case "q":
                self._closing = True
                self._tasks.append(self._loop.create_task(gateway.controller.close()))
            case "!" if event.data == SKY_READY.encode():
                gateway.sky.load()

    def _come(self, event: Event) -> None:
        talk = self._coming.popleft()
        name = surface_and_host(event)[1].removeprefix("pty:")
        talk.come(self.gateway, event, name if name.replace(" ", "_") == talk.name else None)
        self._here[talk.name] = talk
        self.clients += 1
