"""Identifies the mount whenever the line comes up, after sending a stop that is owed.

A motion does not survive the loss of the line: a stop is the first command when it is back. A mount that was not
identified before is probed first, because another kind of mount might misread the bytes of a stop.
"""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer
from gateway.core.signals import Signal
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import DriverRunner, HibernationGate
from gateway.mount.link.queue import READ, STOP
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.readings.own_answers import OwnAnswers
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.contradictions import contradiction_warning
from gateway.mount.shutdown import stop_commands
from gateway.mount.site.settings_sync import SyncSettings

#: Seconds between two attempts to identify a mount that does not reply.
ASK_AGAIN = 1.0


class Identification:
    """Listens to the line. ``identified`` is emitted whenever the mount was identified."""

    def __init__(
        self,
        context: Context,
        runner: DriverRunner,
        gate: HibernationGate,
        reader: Reader,
        own: OwnAnswers,
        sync: SyncSettings,
        reconciler: Reconciler,
        ends: EndWatch,
    ) -> None:
        self._context, self._driver = context, context.driver
        self._link, self._cache, self._runner, self._gate = context.link, context.cache, runner, gate
        self._reader, self._own, self._sync, self._reconciler, self._ends = reader, own, sync, reconciler, ends
        self._asking: asyncio.Task[Any] | None = None
        self.identified: Signal[None] = Signal()
        #: Whether something moved when the port was lost.
        self._cut_short = False
        self._link.came_up.connect(self._on_up)
        self._link.reopened.connect(self._stop_first)
        self._link.lost.connect(self._on_lost)

    def _on_lost(self, _: None) -> None:
        self._cut_short = self._cut_short or self._reconciler.busy or self._ends.pending

    def _stop_first(self, words: list[bytes]) -> None:
        """Stop what moved before the port was lost. ``words`` gets the stop commands if the mount is known."""
        if self._cut_short:
            self._cut_short = False
            self._context.note(
                "the connection to the mount was lost during a motion and is open again: the mount is stopped first"
            )
            self._reconciler.begin_stop("stopped when the connection to the mount was lost and open again")
        if self._reconciler.wanted.owed and self._context.known.is_set():
            words += stop_commands(self._driver, self._link.reply_rules, ends_only=True)

    def _on_up(self, _: None) -> None:
        self._cache.clear()
        self._own.forget(everything=True)
        self._driver.line_was_lost()
        if self._driver.goto_unconfirmed:  # poll the goto until the mount reports its end
            self._cache.put(op.Slewing, True, self._context.now())
        self._gate.try_next_read()
        self._sync.pause()
        if self._asking is not None:
            self._asking.cancel()
        self._asking = self._context.tasks.spawn(self._identify())

    async def _identify(self) -> None:
        """Send a stop that is owed, then read the identity, status, site and clock of the mount."""
        if self._reconciler.wanted.owed:
            with contextlib.suppress(Fault):
                if not self._context.known.is_set():
                    await self._runner.drive(self._driver.probe(), STOP)
                await self._reconciler.stop()
        found = False
        while self._cache.value(op.GetIdentity) is None:
            found = found or await self._find()
            if found:
                await self.learn(op.GetIdentity())
            if self._link.state != "up":
                return  # identification begins again when the line is up
            if self._cache.value(op.GetIdentity) is None:
                await asyncio.sleep(ASK_AGAIN)
        if self._reconciler.wanted.owed:  # the mount did not acknowledge the first stop, but it replies now
            self._reconciler.begin_stop()
        self.identified.emit(None)
        self._context.found.set()
        self._context.known.set()
        await self.learn(op.GetStatus())
        await self.learn(op.GetSite())
        self._context.site_clock.mount_asked()
        if self._has_wrong_hemisphere():
            await self.learn(op.GetStatus())
        await self.learn(op.GetClock())
        self._sync.resume()
        self._context.settled.set()
        if words := contradiction_warning(self._context):
            self._context.note_once(words)

    async def _find(self) -> bool:
        """Return whether a mount is there, and take the position that it may report with its first reply."""
        try:
            place = await self._runner.drive(self._driver.contact(), READ)
        except Fault as fault:
            if not isinstance(fault, NoAnswer):
                self._context.note_once(str(fault))
            return False
        if place is not None:
            self._reader.take(op.Position(), place)
            self._context.found.set()
        return True

    def _has_wrong_hemisphere(self) -> bool:
        """Whether its status was read as northern tracking before the mount reported a southern site."""
        place, status = self._context.sources.site(), self._cache.value(op.GetStatus)
        north = status is not None and status.tracking is op.Tracking.EQ_NORTH
        return north and place is not None and place.latitude < 0.0

    async def learn(self, operation: op.Operation) -> None:
        """Read something once and store it."""
        try:
            value = await self._runner.perform(operation, READ)
        except NoAnswer:
            return
        except Fault as fault:
            self._context.note(str(fault))
            return
        if isinstance(value, op.Place | op.Moment):
            self._sync.take_value(value)
        else:
            self._cache.put(type(operation), value, self._context.now())
