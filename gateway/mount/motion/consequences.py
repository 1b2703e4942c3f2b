"""Updates cached readings and the watches of motion when the mount acknowledges an order. Also logs replaced gotos."""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.motion_kinds import END_ORDERS, GOTOS
from gateway.mount.context import Context
from gateway.mount.link.driver_runner import HibernationGate
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.wanted import Slew, Wanted
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.watch import LimitWatch

#: The least excess of a guide pulse that is logged, as a fraction of the ordered length.
MIN_LOGGED_EXCESS = 0.1


class Consequences:
    """Updates the cache of readings and the watches of motion when the mount has acknowledged an operation.
    ``on_ack_received`` is called before that operation enters ``Wanted``, ``on_ack_stored`` afterwards.
    """

    def __init__(
        self, context: Context, gate: HibernationGate, reader: Reader, watch: LimitWatch, end_watch: EndWatch
    ) -> None:
        self._context, self._clock, self._cache = context, context.now, context.cache
        self._gate, self._reader, self._watch, self._end_watch = gate, reader, watch, end_watch

    def on_stop_sent(self, _: None = None) -> None:
        self._end_watch.watch_end((1, 2), self._watch.max_commanded_speed)

    def on_stop_acknowledged(self) -> None:
        """Handle a stop that the mount has acknowledged: the motors may run on."""
        slewing, by_others = self._context.movement.slewing, self._watch.moved_by_others
        self._context.run_on.begin(after_goto=slewing, moved_by_others=by_others)
        self._reader.note_acknowledged(op.AbortMotion(), by_others)
        self._watch.on_motion_end()
        self._cache.put(op.Slewing, False, self._clock())

    def on_ack_received(self, operation: op.Operation) -> None:
        self._reader.note_acknowledged(operation, isinstance(operation, END_ORDERS) and self._watch.moved_by_others)
        if isinstance(operation, (*GOTOS, op.Move, op.MoveAxis, op.Sync)):
            self._watch.on_motion_start(operation)

    def on_ack_stored(self, operation: op.Operation, wanted_before: Wanted) -> None:
        """Handle an acknowledged operation; ``wanted_before`` is the ``Wanted`` before its acknowledgement."""
        cache, run_on = self._cache, self._context.run_on
        if run_on.current is not None and isinstance(operation, (*GOTOS, op.Move, op.MoveAxis)):
            run_on.forget()
        if isinstance(operation, GOTOS):
            self._log_replaced_goto(wanted_before.motion, self._context.wanted.value.motion)
            cache.put(op.Slewing, True, self._clock())
            cache.forget(op.PierSide)  # the tube may change sides on its way
        elif isinstance(operation, op.Move | op.MoveAxis):
            if isinstance(wanted_before.motion, Slew):
                self._context.note("the goto was stopped before its goal by an arrow")
            cache.mark_changed(op.Position)  # no new position, but it must be polled more often from now on
        elif isinstance(operation, op.StopAxis):
            self._on_axis_halted(operation.axis, wanted_before.hand_moves.get(operation.axis))
        elif isinstance(operation, op.AbortMotion):  # of an arrow that was stopped at once
            self.on_stop_sent()
            self.on_stop_acknowledged()
        elif isinstance(operation, op.AbortSlew):
            if self._context.movement.slewing:
                self._context.run_on.begin(after_goto=True)
            cache.put(op.Slewing, False, self._clock())
        elif isinstance(operation, op.Sync):
            self._on_sync()
        elif isinstance(operation, op.SetTracking | op.Unpark | op.Hibernate | op.Wake):
            cache.forget(op.GetStatus)
            if isinstance(operation, op.Hibernate):
                self.on_stop_acknowledged()
                self._context.run_on.forget()
                self._gate.note_hibernation()

    def on_follow_up_done(self, operation: op.Operation) -> None:
        """After the last step of a park, note in the cached status that tracking is off: no read is needed."""
        status: op.Status | None = self._cache.last_or_forgotten(op.GetStatus)
        if status is not None and self._context.driver.parked and getattr(operation, "then", "") == "park":
            self._cache.correct_value(op.GetStatus, replace(status, tracking=op.Tracking.OFF))

    def log_pulse_excess(self, axis: int, ordered_at: float, sent_at: float) -> None:
        """Log by how much a guide pulse was too long, if by over a tenth. ``ordered_at`` is the loop time at which the
        reconciler took up the order to end the pulse, ``sent_at`` the loop time at which it sent the command.
        """
        pulse = next((sent for sent in self._context.wanted.value.pulses if sent.axis == axis), None)
        late = 0.0 if pulse is None else sent_at - pulse.ends_at
        if pulse is not None and pulse.operation is not None and late > MIN_LOGGED_EXCESS * pulse.operation.ms / 1000.0:
            asleep = max(0.0, ordered_at - pulse.ends_at)
            computer = f"this computer did not run the gateway for {asleep:.2f} s"
            self._context.note(
                f"a guide pulse of {pulse.operation.ms / 1000.0:g} s was {late:.2f} s too long: "
                f"{computer if asleep > late / 2 else 'the line was busy'}"
            )

    def _log_replaced_goto(self, old_motion: object, new_motion: object) -> None:
        """Log that a goto replaces another program's: the last goto wins, and the other program gets no message."""
        old, new = (motion.client if isinstance(motion, Slew) else None for motion in (old_motion, new_motion))
        if old is not None and new is not None and old.program != new.program:
            self._context.note(f"the goto of {new.host} replaces the goto of {old.host}")

    def _on_axis_halted(self, axis: int, ended_motion: op.Move | op.MoveAxis | None) -> None:
        if ended_motion is not None:
            self._end_watch.watch_end((axis,), self._context.driver.speed(ended_motion.rate))
            self._context.run_on.begin(after_goto=False)
        self._watch.on_axis_stop()
        if not self._context.wanted.hand_moves:
            self._watch.on_motion_end()

    def _on_sync(self) -> None:
        """Add the sync to the sum of all syncs, and forget the cached positions, which a sync changes."""
        self._context.syncs.note_acknowledged()
        status = self._cache.last_value(op.GetStatus)
        aligns = (op.GetStatus,) if status is not None and not status.aligned else ()
        self._cache.forget(op.Position, op.HorizontalPosition, op.AxisPosition, *aligns)
