"""A few minutes of a night on every kind of mount; the whole of it is ``python -m tests.soak.long_night``."""

from __future__ import annotations

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.night import PLANS, Plan, night


@pytest.mark.parametrize("plan", PLANS, ids=[f"{plan.presented} on {plan.mount}" for plan in PLANS])
def test_what_is_told_is_where_the_mount_points(plan: Plan) -> None:
    record = run(night(plan, seconds=100.0, goto_every=40.0, seed=1))
    assert not record.wrong, record.wrong[:5]
    assert record.polls > 100
    assert record.gotos >= 2
    assert record.worst > 0.3  # the judge has something to measure
    assert bool(record.pulses) is plan.guided
