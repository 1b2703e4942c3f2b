"""The line swallows a part of a stop: nothing moves ten seconds later. With ``--whole``, each part of it in turn."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from tests.support import sampling
from tests.support.lost_commands import LX200_ENDS, MOUNTS, NEXSTAR_ENDS, Case, play

#: What is slower than a tenth of a degree a second says nothing by its position.
WORDS = [
    *(("lx200", motion, end) for motion, ends in LX200_ENDS.items() for end in ends if motion != "pulse"),
    *(("nexstar", motion, end) for motion, ends in NEXSTAR_ENDS.items() for end in ends if motion != "rate"),
]
#: What of the traffic after the stop is lost: the stop itself, or its third byte.
LOST = [("command", 1), ("byte", 3)]


def losses(case: Case) -> list[Case]:
    """The case with each command, each reply and each byte of its traffic lost in turn, or with a sample of these."""
    if sampling.WHOLE:
        sizes = zip(("command", "reply", "byte"), play(case).size, strict=True)
        lost = [(what, number) for what, size in sizes for number in range(1, size + 1)]
    else:
        lost = LOST if case.motion == "arrow" else LOST[:1]
    return [replace(case, lost=what, number=number) for what, number in lost]


@pytest.mark.parametrize("mount", MOUNTS)
def test_stop_partly_swallowed_by_the_line_stops_the_mount(mount: str) -> None:
    every = sampling.as_a_rule(5, whole=1)
    for program, motion, end in WORDS[list(MOUNTS).index(mount) % every :: every]:  # each on two mounts or three
        for case in losses(Case(mount, program, motion, end)):
            outcome = play(case)
            assert outcome.swallowed, outcome
            assert not outcome.moves, outcome


@pytest.mark.parametrize("mount", MOUNTS)
def test_arrow_whose_command_lost_a_byte_is_stopped(mount: str) -> None:
    order = Case(mount, "lx200", "arrow", b":Q#", "order", "byte", 4)
    for case in losses(order) if sampling.WHOLE else [order]:
        outcome = play(case)
        assert not outcome.moves, outcome
