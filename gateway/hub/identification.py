"""Who is on the line: asked whenever the line is up, after a stop that is owed.

Nothing that moved when the line was lost survives that: its end is the first that the mount hears when it is back. A
mount that nobody knows yet is greeted before, for another kind might misread the bytes of a stop.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway import operations as op
from gateway.errors import Fault, NoAnswer
from gateway.hub.ending import stop_commands
from gateway.hub.refresh import ASK_AGAIN
from gateway.hub.rules import say_doubts
from gateway.line import READ, STOP

if TYPE_CHECKING:
    from gateway.hub.core import Hub


class Identification:
    """``met`` is set once a mount is known to be there, ``known`` once it has said who it is, ``settled`` once it has
    said where and when it is, too.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.met, self.known, self.settled = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self._asking: asyncio.Task[Any] | None = None
        #: Called whenever the mount has said who it is.
        self.told: Callable[[], None] = lambda: None
        #: Something moved when the mount's port was lost.
        self._cut_short = False
        line = hub.line
        line.on_up, line.first_words, line.talk.on_lost = self._on_up, self._first_words, self._on_lost

    def _on_lost(self) -> None:
        self._cut_short = self._cut_short or self._hub.motions.busy or self._hub.ends.pending

    def _first_words(self) -> list[bytes]:
        """The port is open again: nothing that moved survives that. A mount that nobody knows yet is greeted first."""
        if self._cut_short:
            self._cut_short = False
            self._hub.transcript.note(
                "mount", "the line was lost while the mount moved: it is stopped, now that it is back")
            self._hub.motions.begin_stop()
        known = self._hub.motions.owed and self.known.is_set()
        return stop_commands(self._hub.driver, self._hub.line.dialogue, ends_only=True) if known else []

    def _on_up(self) -> None:
        self._hub.snapshot.clear()
        self._hub.own.forget(everything=True)
        self._hub.driver.line_was_lost()
        if self._hub.driver.unsure:  # it is looked at until it is seen to be over
            self._hub.snapshot.put(op.Slewing, True, self._hub.now())
        self._hub.slumber.doubt()
        self._hub.settings.sync.doubt()
        if self._asking is not None:
            self._asking.cancel()
        self._asking = self._hub.spawn(self._identify())

    async def _identify(self) -> None:
        """Who is there, where it stands, what time it has. A stop that is owed goes before everything else."""
        if self._hub.motions.owed:
            with contextlib.suppress(Fault):
                if not self.known.is_set():
                    await self._hub.drive(self._hub.driver.greet(), STOP)
                await self._hub.stop()
        met = False
        while op.GetIdentity not in self._hub.snapshot.seen:
            met = met or await self._meet()
            if met:
                await self.learn(op.GetIdentity())
            if self._hub.line.state != "up":
                return  # it is begun again when the line is up
            if op.GetIdentity not in self._hub.snapshot.seen:
                await asyncio.sleep(ASK_AGAIN)
        if self._hub.motions.owed:  # it did not answer to the stop, but it does now
            self._hub.begin_stop()
        if self._hub.policy.equinox == "auto":
            self._hub.derived.equinox = self._hub.told.equinox = self._hub.driver.equinox
        self.told()
        self.met.set()
        self.known.set()
        await self.learn(op.GetStatus())
        await self.learn(op.GetSite())
        if self._counts_from_the_other_pole():
            await self.learn(op.GetStatus())
        await self.learn(op.GetClock())
        self._hub.settings.sync.resume()
        self.settled.set()
        say_doubts(self._hub)

    async def _meet(self) -> bool:
        """Whether a mount is there: from then on it can be asked where it points, whoever it is."""
        try:
            place = await self._hub.drive(self._hub.driver.contact(), READ)
        except Fault as fault:
            if not isinstance(fault, NoAnswer):
                self._hub.transcript.note_once("mount", str(fault))
            return False
        if place is not None:
            self._hub.reader.told(op.Position(), place)
            self.met.set()
        return True

    def _counts_from_the_other_pole(self) -> bool:
        """Whether it was taken to follow the northern sky before it told that it stands in the south."""
        place, status = self._hub.observatory.site(), self._hub.snapshot.value(op.GetStatus)
        north = status is not None and status.tracking is op.Tracking.EQ_NORTH
        return north and place is not None and place.latitude < 0.0

    async def learn(self, operation: op.Operation) -> None:
        """Ask for something that is told but once."""
        try:
            value = await self._hub.drive(self._hub.driver.perform(operation), READ)
        except NoAnswer:
            return
        except Fault as fault:
            self._hub.transcript.note("mount", str(fault))
            return
        if isinstance(value, op.Place | op.Moment):
            self._hub.settings.sync.heard(value)
        else:
            self._hub.snapshot.put(type(operation), value, self._hub.now())
