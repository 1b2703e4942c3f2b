"""The dead man's switch: fast motion by hand, and the focuser's, needs somebody at the other end.

Who began it must be heard of: any byte of any connection of the same host counts, because some programs open a
connection for every command. Rates up to 60" a second are somebody's tracking and go on; gotos end by themselves.
"""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

from msgspec import Struct

from gateway import operations as op
from gateway.errors import Fault

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: Up to so many degrees a second a motion by hand is somebody's own tracking.
TRACKING = 60.0 / 3600.0
#: How often it is looked after somebody.
EVERY = 0.5
#: A host that has been away for so long is forgotten.
FORGET = 60.0
FOCUSER = 3


class Life:
    """A host. ``heard`` is set by whatever it sends, and taken back when that was noticed."""

    __slots__ = ("closed", "heard", "last", "open", "who")

    def __init__(self, who: str) -> None:
        self.who = who
        self.heard = False
        self.open = 0
        self.last = self.closed = 0.0


class Held(Struct, frozen=True):
    """A motion that needs somebody: who it is, and when it was begun."""

    life: Life
    since: float


class DeadMan:
    """``patience`` and ``closed`` are the seconds of silence on an open connection and after the last one closed."""

    def __init__(self, hub: Hub, patience: float, closed: float) -> None:
        self._hub, self._patience, self._closed = hub, patience, closed
        self._lives: dict[str, Life] = {}
        self._held: dict[int, Held] = {}
        self._watch: asyncio.Task[None] | None = None

    # --- who is there -----------------------------------------------------------------------------------------------

    def arrive(self, host: str) -> Life:
        """A connection from this host was opened."""
        now = self._hub.now()
        for old in [life for life in self._lives.values() if not life.open and now - life.closed > FORGET]:
            del self._lives[old.who]
        life = self._lives.setdefault(host, Life(host))
        life.open += 1
        life.heard = True
        return life

    def leave(self, life: Life) -> None:
        """One of its connections was closed."""
        life.open -= 1
        life.closed = self._hub.now()

    # --- what moves -------------------------------------------------------------------------------------------------

    def began(self, operation: op.Operation, life: Life | None) -> None:
        """A motion was carried out: it may need somebody, or end what did."""
        match operation:
            case op.Move() | op.MoveAxis():
                axis = operation.axis
                self._hold(axis, life, self._hub.driver.speed(operation.rate) > TRACKING)
            case op.Focus():
                self._hold(FOCUSER, life, operation.direction != 0)
            case op.Halt():
                self._held.pop(operation.axis, None)
            case op.Goto() | op.GotoHorizontal() | op.GotoAxes() | op.Park() | op.Home():
                self._held.pop(1, None)
                self._held.pop(2, None)

    def stopped(self) -> None:
        """Every motion of the mount was ended; a focuser goes on."""
        self._held.pop(1, None)
        self._held.pop(2, None)

    def _hold(self, axis: int, life: Life | None, needed: bool) -> None:
        if life is None or not needed:
            self._held.pop(axis, None)
            return
        self._held[axis] = Held(life, self._hub.now())
        if self._watch is None or self._watch.done():
            self._watch = self._hub.spawn(self._look_after())

    async def _look_after(self) -> None:
        """While anything needs somebody, see whether they are there."""
        hub = self._hub
        while self._held:
            await asyncio.sleep(EVERY)
            now = hub.now()
            for axis, held in list(self._held.items()):
                life = held.life
                if life.heard:
                    life.heard, life.last = False, now
                silent = now - max(life.last, held.since)
                gone = not life.open and now - max(life.closed, held.since) >= self._closed
                if gone or silent >= self._patience:
                    del self._held[axis]
                    hub.transcript.note("mount", f"{life.who} {'is gone' if gone else 'has fallen silent'}: "
                                                 f"{'the focuser' if axis == FOCUSER else 'its motion'} is stopped")
                    hub.spawn(self._end(axis))

    async def _end(self, axis: int) -> None:
        try:
            await self._hub.perform(op.Focus(0) if axis == FOCUSER else op.Halt(axis))
        except Fault as fault:
            self._hub.transcript.note("mount", f"it did not stop: {fault}")
