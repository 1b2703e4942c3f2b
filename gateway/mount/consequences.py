"""What is known without asking once the mount has acknowledged an order, and who has to look at it from now on."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.motion_kinds import ENDS, GOTOS
from gateway.mount.context import Context
from gateway.mount.link.hibernation import HibernationGate
from gateway.mount.motion.outcomes import Done
from gateway.mount.motion.reconciler import Reconciler
from gateway.mount.motion.wanted import WantedState
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.readings.told_position import ToldPosition
from gateway.mount.safety.assembled import Safety
from gateway.mount.site.astrometry import SiteAstrometry


class Consequences:
    """Listens to the reconciler; nobody knows it."""

    def __init__(
        self,
        context: Context,
        gate: HibernationGate,
        cache: ReadingsCache,
        told: ToldPosition,
        wanted: WantedState,
        astrometry: SiteAstrometry,
        safety: Safety,
        reconciler: Reconciler,
    ) -> None:
        self._driver, self._now, self._gate = context.driver, context.now, gate
        self._cache, self._told, self._wanted, self._astrometry = cache, told, wanted, astrometry
        self._watch, self._ends, self._synced = safety.watch, safety.ends, safety.synced
        reconciler.begins.connect(self._begins)
        reconciler.done.connect(self._done)
        reconciler.stop_sent.connect(self._stop_sent)
        reconciler.at_rest.connect(self._at_rest)

    def _stop_sent(self, _: None) -> None:
        self._ends.sent((1, 2), self._watch.fastest)

    def _at_rest(self, _: None) -> None:
        """A stop was acknowledged."""
        self._told.ordered(op.AbortMotion(), self._watch.restless)
        self._watch.ended()
        self._cache.put(op.Slewing, False, self._now())

    def _begins(self, operation: op.Operation) -> None:
        self._told.ordered(operation, isinstance(operation, ENDS) and self._watch.restless)
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._watch.began(operation)

    def _done(self, done: Done) -> None:
        operation, cache = done.operation, self._cache
        if isinstance(operation, GOTOS):
            self._ends.moves((1, 2))
            cache.put(op.Slewing, True, self._now())
            cache.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            self._ends.moves((operation.axis,))
            cache.ask_soon(op.Position)
        elif isinstance(operation, op.StopAxis):
            self._halted(operation.axis, done.before.by_hand.get(operation.axis))
        elif isinstance(operation, op.AbortSlew):
            cache.put(op.Slewing, False, self._now())
        elif isinstance(operation, op.Sync):
            self._has_synced(operation)
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Hibernate | op.Wake):
            cache.forget(op.GetStatus)
            if isinstance(operation, op.Hibernate):
                self._at_rest(None)
                self._gate.begun()

    def _halted(self, axis: int, moved: op.Move | op.MoveAxis | None) -> None:
        """One axis was ended."""
        if moved is not None:
            self._ends.sent((axis,), self._driver.speed(moved.rate))
        self._watch.halted()
        if not self._wanted.by_hand:
            self._watch.ended()

    def _has_synced(self, operation: op.Sync) -> None:
        """Where the mount believes to point is another place now; all syncs add up."""
        status, here = self._cache.value(op.GetStatus), self._cache.value(op.Position)
        if status is not None and status.aligned and here is not None:
            there = self._astrometry.from_mount(op.Equatorial(operation.ra, operation.dec))
            self._synced.add(here, there, status.equatorial)
        aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
        self._cache.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
