"""A fixed evening and fixed attacks of the instrument: how many harmless gotos are lost, and which attacks get through.

The counts may only become smaller. ``python -m tests.support.instrument`` plays as many as one likes.
"""

from __future__ import annotations

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.instrument.attacks import assault, attacks
from tests.support.instrument.evening import evening, prepare
from tests.support.instrument.worlds import KINDS

#: Slip, day, what the owner wrote as lowest, whether each second goto is Hamlib's park -> harmless gotos lost.
EVENINGS = {
    ("right", False, None, False): 28, ("right", True, None, False): 14, ("zone +1 h", False, None, False): 34,
    ("right", False, None, True): 60,
}  # fmt: skip
#: Attacks that get through today: what nobody but the mount can know.
THROUGH = {
    "the same, nobody else knows the site lx200gps", "told clock +1 h, low gotos cpc",
    "told clock -5 h, low gotos synscan-az", "a sync of +14°, over the top lx200gps polar",
    "a sync of -14°, arrows down classic",
}  # fmt: skip


@pytest.mark.parametrize("played", EVENINGS)
def test_what_harmless_gotos_are_lost(played: tuple[str, bool, float | None, bool]) -> None:
    prepare()
    slip, day, lowest, park = played
    told = [one for kind in list(KINDS)[:: 2 if park else 1]
            for one in run(evening(kind, slip, day, 1, lowest, park))[:6]]  # fmt: skip
    assert not any(one.through for one in told)
    assert sum(one.lost and one.new for one in told) <= EVENINGS[played]


def test_which_attacks_get_through() -> None:
    prepare()
    through = []
    for number, attack in enumerate(attacks()):
        found = run(assault(attack, attack.kinds[(number * 5) % len(attack.kinds)], number))
        through += [f"{attack.name} {found.kind}"] if found.through else []
    assert set(through) <= THROUGH
