"""Fixed evenings and attacks of the instrument: how many harmless gotos are lost, and that no attack gets through.

The counts may only become smaller. ``python -m tests.support.instrument`` plays as many as one likes.
"""

from __future__ import annotations

import pytest

from gateway.diagnostics.virtual_time import run
from tests.support.instrument.attacks import Attack, assault, attacks
from tests.support.instrument.evening import evening
from tests.support.instrument.worlds import KINDS
from tests.support.sampling import as_a_rule

#: Slip, day, what the owner wrote as lowest, whether each second goto is Hamlib's park -> harmless gotos lost.
EVENINGS = {
    ("right", False, None, False): 0, ("right", True, None, False): 2, ("zone +1 h", False, None, False): 0,
    ("right", False, None, True): 0,
}  # fmt: skip


@pytest.mark.parametrize("played", EVENINGS)
def test_number_of_harmless_gotos_refused_stays_within_the_bound(played: tuple[str, bool, float | None, bool]) -> None:
    slip, day, lowest, park = played
    every = as_a_rule(2, whole=1)  # the other kinds of mount are in the next row
    kinds = list(KINDS)[list(EVENINGS).index(played) % every :: every]
    told = [one for kind in kinds for one in run(evening(kind, slip, day, 1, lowest, park, 6))]
    assert not any(one.through for one in told)
    assert sum(one.lost and one.harmless and one.up for one in told) <= EVENINGS[played]


@pytest.mark.parametrize(("number", "attack"), [*enumerate(attacks())], ids=lambda value: getattr(value, "name", ""))
async def test_no_hostile_scenario_moves_the_tube_past_a_limit(number: int, attack: Attack) -> None:
    found = await assault(attack, attack.kinds[(number * 5) % len(attack.kinds)], number)
    assert not found.through, str(found)
