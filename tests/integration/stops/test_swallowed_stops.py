"""The line swallows a part of a stop: nothing moves ten seconds later. Every place: ``tests/support/swallow.py``."""

from __future__ import annotations

import pytest

from tests.support.sampling import as_a_rule
from tests.support.swallow import LX200_ENDS, MOUNTS, NEXSTAR_ENDS, Case, play

#: What is slower than a tenth of a degree a second says nothing by its position.
WORDS = [
    *(("lx200", motion, end) for motion, ends in LX200_ENDS.items() for end in ends if motion != "pulse"),
    *(("nexstar", motion, end) for motion, ends in NEXSTAR_ENDS.items() for end in ends if motion != "rate"),
]
#: What of the traffic after the stop is lost: the stop itself, or its third byte.
LOST = [("command", 1), ("byte", 3)]


@pytest.mark.parametrize("mount", MOUNTS)
def test_a_stop_that_is_swallowed_in_part_is_a_stop(mount: str) -> None:
    every = as_a_rule(5, whole=1)
    for program, motion, end in WORDS[list(MOUNTS).index(mount) % every :: every]:  # each on two mounts or three
        for lost, number in LOST if motion == "arrow" else LOST[:1]:
            outcome = play(Case(mount, program, motion, end, "stop", lost, number))
            assert outcome.swallowed, outcome
            assert not outcome.moves, outcome


@pytest.mark.parametrize("mount", MOUNTS)
def test_an_order_that_is_swallowed_in_part_is_stopped_all_the_same(mount: str) -> None:
    outcome = play(Case(mount, "lx200", "arrow", b":Q#", "order", "byte", 4))
    assert not outcome.moves, outcome
