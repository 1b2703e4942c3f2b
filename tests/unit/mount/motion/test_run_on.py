"""A run-on as values: which positions show rest, and what it remembers of the motion."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.motion.run_on import RunOn, RunOnWatch, TimedPosition, after_position

HERE = op.Equatorial(120.0, 30.0)


def test_only_positions_requested_after_a_stop_show_a_mount_at_rest() -> None:
    run_on: RunOn | None = RunOn(10.0, True, 10.0)
    for asked, rests in ((9.9, False), (10.4, False), (10.8, True)):
        assert run_on is not None
        run_on = after_position(run_on, TimedPosition(asked + 0.2, asked, HERE), False, 0.01)
        assert (run_on is None) is rests


def test_second_stop_keeps_a_run_on_attributed_to_the_goto() -> None:
    watch = RunOnWatch(lambda: 10.0)
    watch.may_move.emit(None)
    watch.begin(after_goto=True)
    watch.begin(after_goto=False)
    assert watch.is_after_goto
