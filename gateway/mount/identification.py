"""Who is on the line: asked whenever the line is up, after a stop that is owed.

Nothing that moved when the line was lost survives that: its end is the first that the mount hears when it is back. A
mount that nobody knows yet is greeted before, for another kind might misread the bytes of a stop.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.mount.link.queue import READ, STOP
from gateway.mount.readings.poller import ASK_AGAIN
from gateway.mount.safety_inputs import say_doubts
from gateway.mount.shutdown import stop_commands

if TYPE_CHECKING:
    from gateway.mount.controller import MountController


class Identification:
    """``met`` is set once a mount is known to be there, ``known`` once it has said who it is, ``settled`` once it has
    said where and when it is, too.
    """

    def __init__(self, controller: MountController) -> None:
        self._controller = controller
        self.met, self.known, self.settled = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self._asking: asyncio.Task[Any] | None = None
        #: Called whenever the mount has said who it is.
        self.told: Callable[[], None] = lambda: None
        #: Something moved when the mount's port was lost.
        self._cut_short = False
        line = controller.line
        line.on_up, line.first_words, line.talk.on_lost = self._on_up, self._first_words, self._on_lost

    def _on_lost(self) -> None:
        self._cut_short = self._cut_short or self._controller.motions.busy or self._controller.ends.pending

    def _first_words(self) -> list[bytes]:
        """The port is open again: nothing that moved survives that. A mount that nobody knows yet is greeted first."""
        if self._cut_short:
            self._cut_short = False
            self._controller.transcript.note(
                "mount",
                "the connection to the mount was lost while it moved and is back now: the mount is stopped first",
            )
            self._controller.motions.begin_stop()
        known = self._controller.motions.owed and self.known.is_set()
        return stop_commands(self._controller.driver, self._controller.line.dialogue, ends_only=True) if known else []

    def _on_up(self) -> None:
        self._controller.snapshot.clear()
        self._controller.own.forget(everything=True)
        self._controller.driver.line_was_lost()
        if self._controller.driver.unsure:  # it is looked at until it is seen to be over
            self._controller.snapshot.put(op.Slewing, True, self._controller.now())
        self._controller.slumber.doubt()
        self._controller.settings.sync.doubt()
        if self._asking is not None:
            self._asking.cancel()
        self._asking = self._controller.spawn(self._identify())

    async def _identify(self) -> None:
        """Who is there, where it stands, what time it has. A stop that is owed goes before everything else."""
        if self._controller.motions.owed:
            with contextlib.suppress(Fault):
                if not self.known.is_set():
                    await self._controller.drive(self._controller.driver.greet(), STOP)
                await self._controller.stop()
        met = False
        while op.GetIdentity not in self._controller.snapshot.seen:
            met = met or await self._meet()
            if met:
                await self.learn(op.GetIdentity())
            if self._controller.line.state != "up":
                return  # it is begun again when the line is up
            if op.GetIdentity not in self._controller.snapshot.seen:
                await asyncio.sleep(ASK_AGAIN)
        if self._controller.motions.owed:  # it did not answer to the stop, but it does now
            self._controller.begin_stop()
        if self._controller.policy.equinox == "auto":
            self._controller.derived.equinox = self._controller.told.equinox = self._controller.driver.equinox
        self.told()
        self.met.set()
        self.known.set()
        await self.learn(op.GetStatus())
        await self.learn(op.GetSite())
        if self._counts_from_the_other_pole():
            await self.learn(op.GetStatus())
        await self.learn(op.GetClock())
        self._controller.settings.sync.resume()
        self.settled.set()
        say_doubts(self._controller)

    async def _meet(self) -> bool:
        """Whether a mount is there: from then on it can be asked where it points, whoever it is."""
        try:
            place = await self._controller.drive(self._controller.driver.contact(), READ)
        except Fault as fault:
            if not isinstance(fault, NoAnswer):
                self._controller.transcript.note_once("mount", str(fault))
            return False
        if place is not None:
            self._controller.reader.told(op.Position(), place)
            self.met.set()
        return True

    def _counts_from_the_other_pole(self) -> bool:
        """Whether it was taken to follow the northern sky before it told that it stands in the south."""
        place, status = self._controller.observatory.site(), self._controller.snapshot.value(op.GetStatus)
        north = status is not None and status.tracking is op.Tracking.EQ_NORTH
        return north and place is not None and place.latitude < 0.0

    async def learn(self, operation: op.Operation) -> None:
        """Ask for something that is told but once."""
        try:
            value = await self._controller.drive(self._controller.driver.perform(operation), READ)
        except NoAnswer:
            return
        except Fault as fault:
            self._controller.transcript.note("mount", str(fault))
            return
        if isinstance(value, op.Place | op.Moment):
            self._controller.settings.sync.heard(value)
        else:
            self._controller.snapshot.put(type(operation), value, self._controller.now())
