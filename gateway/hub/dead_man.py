"""The dead man's switch: fast motion by hand, and the focuser's, needs somebody at the other end.

Who began it must be heard of: while the connection that did so is open, its own bytes count and nobody else's, for
another program on the same computer does not hold that arrow. Once it is closed, connections count that the same host
has opened since: some programs open one for every command. Rates up to 60" a second are somebody's tracking and go on;
gotos end by themselves.
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
#: A connection that was closed so long ago is forgotten.
FORGET = 60.0
FOCUSER = 3


class Life:
    """A connection of the host ``who``. ``heard`` is set by whatever it sends, and taken back when that was noticed."""

    __slots__ = ("closed", "heard", "last", "opened", "who")

    def __init__(self, who: str, opened: float) -> None:
        self.who, self.opened = who, opened
        self.heard = True
        self.last = opened
        self.closed: float | None = None


class Held(Struct, frozen=True):
    """A motion that needs somebody: whose it is, and when it was begun."""

    life: Life
    since: float


class DeadMan:
    """``patience`` and ``closed`` are the seconds of silence on an open connection and after the last one closed."""

    def __init__(self, hub: Hub, patience: float, closed: float) -> None:
        self._hub, self._patience, self._closed = hub, patience, closed
        self._lives: dict[str, list[Life]] = {}
        self._held: dict[int, Held] = {}
        self._swept = hub.now()
        self._watch: asyncio.Task[None] | None = None

    # --- who is there -----------------------------------------------------------------------------------------------

    def arrive(self, host: str) -> Life:
        """A connection from this host was opened."""
        now = self._hub.now()
        if now - self._swept > FORGET:
            self._swept = now
            for who, lives in list(self._lives.items()):
                self._lives[who] = [life for life in lives if life.closed is None or now - life.closed <= FORGET]
                if not self._lives[who]:
                    del self._lives[who]
        life = Life(host, now)
        self._lives.setdefault(host, []).append(life)
        return life

    def was_nobody(self, life: Life) -> None:
        """It has turned out to be a stranger's, and counts as if it had never been opened."""
        self._lives[life.who].remove(life)

    def leave(self, life: Life) -> None:
        """It was closed."""
        life.closed = self._hub.now()

    def _stands_for(self, life: Life) -> list[Life]:
        """The connections whose bytes count for it: itself, and once it is closed, those that its host opened since."""
        closed = life.closed
        if closed is None:
            return [life]
        return [life, *(later for later in self._lives.get(life.who, ()) if later.opened >= closed)]

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
                life, there = held.life, self._stands_for(held.life)
                for one in there:
                    if one.heard:
                        one.heard, one.last = False, now
                silent = now - max(held.since, *(one.last for one in there))
                left = [one.closed for one in there if one.closed is not None]
                gone = len(left) == len(there) and now - max(held.since, *left) >= self._closed
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
