"""Replay a recording turn by turn: every input comes at the recorded turn and time.

The gateway is set up as it was and runs on a loop with the time of the recording. It is not guided otherwise: its
requests to the mount and its replies to clients are compared with the recorded ones. The recording is read as the
replay advances, and outputs are only kept until they have been compared.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque

from gateway.app.control.orders import stopped
from gateway.app.gateway import Gateway
from gateway.app.recording.format import Event, Recording
from gateway.app.recording.turns import BASE
from gateway.core.requests import decode
from gateway.core.wire_log import MOUNT, SKY_READY
from gateway.diagnostics.replay.replies import Difference, ReplayedConnection, surface_and_host
from gateway.diagnostics.replay.retraced import TOLD, RetracedEntrance, RetracedLoop, RetracedWire, Turn, turns
from gateway.mount.link.line import MountLink

#: How long the gateway may take to end after the last event, seconds.
AFTERWARDS = 1.0


class Retracing:
    """Replays a recording to ``gateway``, which is not set up yet."""

    def __init__(self, gateway: Gateway, loop: RetracedLoop) -> None:
        self.gateway, self._loop = gateway, loop
        self.entrance = RetracedEntrance()
        self.wire = RetracedWire(self.entrance, lambda: loop.elapsed, gateway.mount.where.startswith("http"))
        self.clients = self.replies = 0
        self.differences: list[Difference] = []
        self._here: dict[str, ReplayedConnection] = {}
        #: The connections as far as the recording has been read, which is ahead of what has been replayed.
        self._there: dict[str, ReplayedConnection] = {}
        self._coming: deque[ReplayedConnection] = deque()
        self._touched: list[ReplayedConnection] = []
        self._left: list[ReplayedConnection] = []
        self._tasks: list[asyncio.Task[object]] = []
        self._host = float("nan")
        #: Whether the recording includes the end of the gateway.
        self._closing = False
        self.wire.over = lambda: loop.over
        gateway.clock = self.clock
        gateway.entrance = self.entrance

    def clock(self) -> float:
        """Return the recorded clock of the host, Unix seconds."""
        return self._host + self._loop.time() - BASE

    async def run(self, recording: Recording) -> None:
        """Replay the recording as far as it goes. Raises UserError."""
        self._host = float(recording.settings["began"])
        self._loop.elapsed = float(recording.settings.get("elapsed", 0.0))
        self.gateway.prepare(lambda reply_rules, wire_log: MountLink(self.wire, reply_rules, wire_log))
        try:
            await self._loop.follow(turns(recording), self._begin, self._play)
            self._compare()
            for talk in self._here.values():
                talk.compare(less=True)
                self._settle(talk)
        finally:
            await self._end()

    async def _end(self) -> None:
        """End the replay: release all waits and close the gateway."""
        self.wire.ended = True
        self.entrance.release()
        await asyncio.sleep(AFTERWARDS)
        if not self._closing:
            await self.gateway.controller.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    # --- turn by turn -----------------------------------------------------------------------------------------------

    def _begin(self, turn: Turn) -> None:
        """Begin a turn of the recording: all outputs recorded so far must have been repeated."""
        self._compare()
        for event in turn.events:
            if event.arrow == "k":
                self._host = float(event.data)  # from the beginning of this turn
            elif event.side == MOUNT:
                self.wire.then(event)
            elif event.arrow == "+":
                self._there[event.side] = ReplayedConnection(event.side)
                self._coming.append(self._there[event.side])
            elif event.arrow == "-":
                self._there.pop(event.side, None)  # later replies to it were not delivered
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

    def _settle(self, talk: ReplayedConnection) -> None:
        if talk.difference is not None and len(self.differences) < TOLD:
            self.differences.append(talk.difference)

    def _play(self, event: Event) -> None:
        """Replay an input."""
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
                with contextlib.suppress(ValueError):  # an unknown request had no effect
                    request = decode(event.data.decode("latin-1"))
                    carried_out = gateway.request_handler.carry_out(request)
                    self._tasks.append(self._loop.create_task(carried_out))
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
