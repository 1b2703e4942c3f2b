"""The heart on every second kind of mount, a play each, or on every one, eight each; the same in every run.

Judged by the axes of the simulators. More by hand: ``python -m tests.property.heart_plays --examples 300 --mount cpc``.
A play that fails is shown as small as it gets.
"""

from __future__ import annotations

from itertools import count, islice

import pytest

from tests.property.heart_plays import examples, play, smallest
from tests.property.line_of_faults import Fault
from tests.property.orders import Event
from tests.property.scripts import KNOWN, MOUNTS, Script
from tests.support.sampling import as_a_rule

EXAMPLES = as_a_rule(1, whole=8)
#: The first play of some and the second of others: either protocol three times, and every way to end.
SECOND = as_a_rule(1, whole=0)
BEGINS = {"cpc": SECOND, "6-8se": SECOND, "gt": SECOND}
ARROW = (Event(1.0, 1, "arrow", ("e", "max")),)


@pytest.mark.sampled(every=2)
@pytest.mark.parametrize("mount", list(MOUNTS))
def test_randomly_commanded_mount_stays_within_limits_and_ends_as_ordered(mount: str) -> None:
    seeds = (seed for seed in count(BEGINS.get(mount, 0)) if seed not in KNOWN.get(mount, {}))
    for _, script, wrong in examples(mount, islice(seeds, EXAMPLES)):
        small = smallest(script, wrong)
        pytest.fail(f"{'; '.join(play(small))}\n{small.words()}")


@pytest.mark.sampled(1)
@pytest.mark.parametrize("mount", ["cpc", "cge", "slt", "nexstar-gps-2.2", "autostar"])
@pytest.mark.parametrize("kind", ["lost", "unheard", "doubled", "broken", "cut"])
def test_arrow_motion_ends_when_its_client_leaves_despite_line_faults(mount: str, kind: str) -> None:
    """The fault meets each of the requests in turn that the arrow consists of, or as a rule every second one."""
    every = as_a_rule(2, whole=1)
    for late in (0.0, 0.1, 0.2, 0.4)[len(kind) % every :: every]:
        fault = Fault(round(1.0 + late, 1), kind, 3.0 if kind == "cut" else 0.0)
        script = Script(mount, "lx200", False, 5.0, (150.0, 40.0), False, 0.05, "leave", ARROW, (fault,))
        assert play(script) == [], script.words()
