"""Random sequences against every model, both ways: a few plays that always run.

The long run is ``python -m tests.soak.random_sequences``. A play that fails names its seed; with ``--seed N --plays 1
--said`` the tool plays it again.
"""

from __future__ import annotations

import os
import random

import pytest

from tests.property import random_by_hand
from tests.property.random_play import MOUNTS, Play, cast, play
from tests.support.sampling import as_a_rule

#: The same in every run, so that a green suite stays green; RANDOM_SEQUENCES=any plays others.
FIRST = 7000
STEPS = 12


def seeds() -> list[int]:
    """One for every third mount: two thirds of them under the other protocol."""
    first = random.randrange(10**6) if os.environ.get("RANDOM_SEQUENCES") else FIRST
    return [
        first - first % len(MOUNTS) + number * (3 * len(MOUNTS) + 1) + (number % 3) * len(MOUNTS)
        for number in range(0, len(MOUNTS), 3)
    ]


@pytest.mark.sampled(every=3)
@pytest.mark.parametrize("seed", seeds())
def test_whatever_is_said_nothing_breaks_and_no_limit_is_crossed(seed: int) -> None:
    done: Play = play(seed, STEPS, *cast(seed))
    assert not done.complaints, (done.name, done.complaints, done.said)
    assert done.steps >= STEPS
    assert done.looks > 50


@pytest.mark.sampled(every=9)
@pytest.mark.parametrize("seed", seeds())
def test_sources_that_contradict_each_other_bring_no_tube_beyond_a_limit(seed: int) -> None:
    done = play(seed, 2 * STEPS, *cast(seed), contradicting=True)
    assert not done.complaints, (done.name, done.complaints, done.said)


@pytest.mark.sampled(every=4)
@pytest.mark.parametrize("seed", range(FIRST, FIRST + 10))
def test_no_arrow_crosses_a_limit_that_is_near(seed: int) -> None:
    done = random_by_hand.play(seed, as_a_rule(2, whole=random_by_hand.SCENES))
    assert not done.complaints, (done.name, done.complaints, done.said)
    assert done.looks > 500
