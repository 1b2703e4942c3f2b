"""The order of a run is drawn by chance, so that no test comes to need what another one has left behind.

The tests of a module stay together, because they share what it sets up, and so do those of the console's page, which
share a browser. Modules that wait for real programs come to lie between those that keep a processor busy. The seed is
printed at the end; ``TEST_ORDER=7 pytest`` repeats an order.
"""

from __future__ import annotations

import os
from random import Random, SystemRandom

import pytest

#: The folder whose tests share a browser and a gateway, and keep their order.
IN_ORDER = "tests/programs/console/"


def seed() -> str:
    """Return the seed of this run, which its worker processes inherit."""
    return os.environ.setdefault("TEST_ORDER", str(SystemRandom().randrange(10_000)))


def shuffled(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests group by group, the groups and their tests in the order of the seed."""
    chance, groups = Random(seed()), dict[str, list[pytest.Item]]()
    for item in items:
        path = item.nodeid.partition("::")[0]
        groups.setdefault(IN_ORDER if path.startswith(IN_ORDER) else path, []).append(item)
    for group, tests in groups.items():
        if group != IN_ORDER:
            chance.shuffle(tests)
    order = list(groups)
    chance.shuffle(order)
    return [item for group in order for item in groups[group]]
