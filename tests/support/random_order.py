"""The order of a run is drawn by chance, so that no test comes to need what another one has left behind.

The tests of a module stay together, because they share what it sets up. Modules that wait for real programs come to lie
between those that keep a processor busy. The seed is printed at the end; ``TEST_ORDER=7 pytest`` repeats an order.
"""

from __future__ import annotations

import os
from random import Random, SystemRandom

import pytest

#: The folder whose tests share a page and a gateway within a module, and keep their order.
IN_ORDER = "tests/programs/console/"


def seed() -> str:
    """Return the seed of this run, which its worker processes inherit."""
    return os.environ.setdefault("TEST_ORDER", str(SystemRandom().randrange(10_000)))


def shuffled(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests module by module, the modules and their tests in the order of the seed."""
    chance, modules = Random(seed()), dict[str, list[pytest.Item]]()
    for item in items:
        modules.setdefault(item.nodeid.partition("::")[0], []).append(item)
    for path, tests in modules.items():
        if not path.startswith(IN_ORDER):
            chance.shuffle(tests)
    paths = list(modules)
    chance.shuffle(paths)
    return [item for path in paths for item in modules[path]]
