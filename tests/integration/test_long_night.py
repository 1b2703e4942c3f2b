"""A few minutes of a night on every kind of mount, or eight hours with ``--whole``: nothing drifts, nothing grows."""

from __future__ import annotations

import gc

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.night import PLANS, Plan, night
from tests.support.sampling import as_a_rule

#: Objects more from the first to the last hour: a deque that fills, a cache, cancelled timers of the virtual loop.
GROWTH = 1200


@pytest.mark.parametrize("plan", PLANS, ids=[f"{plan.presented} on {plan.mount}" for plan in PLANS])
def test_reported_positions_are_where_the_mount_points(plan: Plan) -> None:
    objects: list[int] = []

    def count() -> None:
        gc.collect()
        objects.append(len(gc.get_objects()))

    seconds, goto_every = as_a_rule(100.0, whole=8 * 3600.0), as_a_rule(40.0, whole=480.0)
    record = run(night(plan, seconds, goto_every, 1, count))
    assert not record.wrong, record.wrong[:5]
    assert record.polls > 100
    assert record.gotos >= 2
    assert record.worst > 0.3  # the judge has something to measure
    assert bool(record.pulses) is plan.guided
    assert objects[-1] - objects[min(1, len(objects) - 1)] <= GROWTH
