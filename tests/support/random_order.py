"""The order of a run is drawn by chance, so that no test comes to need what another one has left behind.

The tests of a module stay together, because they share what it sets up. Each worker process begins with its share of
the tests that wait for real programs: at the end of a run a long test would keep one worker busy and the others idle.
The seed is printed at the end; ``TEST_ORDER=7 pytest`` repeats an order.
"""

from __future__ import annotations

import os
from itertools import islice
from random import Random, SystemRandom

import pytest

#: The package whose tests share a page and a gateway within a module, and keep their order; and the number of workers
#: that share its modules, as each of them starts a browser.
IN_ORDER, BROWSERS = "tests/programs/console/", 4
#: Tests that wait for programs or for real time, and modules with single tests that take long.
WAITING = (
    "tests/programs/", "tests/project/", "tests/conformance/ascom/", "tests/integration/any_port/",
    "tests/integration/safety/test_horizon", "tests/integration/safety/test_instrument",
    "tests/integration/safety/test_sun_ahead", "tests/integration/stops/test_s", "tests/unit/app/", "tests/unit/cli/",
    "tests/unit/clients/test_", "tests/unit/console/test_", "tests/unit/transport/",
)  # fmt: skip


def seed() -> str:
    """Return the seed of this run, which its worker processes inherit."""
    return os.environ.setdefault("TEST_ORDER", str(SystemRandom().randrange(10_000)))


def shuffled(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests module by module, the modules and their tests in the order of the seed.

    pytest-xdist gives each worker an equal share of them, and a worker that has ended takes tests from another's end.
    """
    chance, modules = Random(seed()), dict[str, list[pytest.Item]]()
    for item in items:
        modules.setdefault(item.nodeid.partition("::")[0], []).append(item)
    for path, tests in modules.items():
        if not path.startswith(IN_ORDER):
            chance.shuffle(tests)
    paths = list(modules)
    chance.shuffle(paths)
    browsing = [path for path in paths if path.startswith(IN_ORDER)]
    waiting = [path for path in paths if path.startswith(WAITING) and path not in browsing]
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    shares: list[list[pytest.Item]] = [[] for _ in range(workers)]
    for path in (*browsing, *waiting):
        share = min(shares[:BROWSERS] if path in browsing else shares, key=len)
        share += modules.pop(path)
    others = (item for path in paths for item in modules.get(path, ()))
    for number, share in enumerate(shares):
        size = len(items) * (number + 1) // workers - len(items) * number // workers
        share += islice(others, max(0, size - len(share)))
    return [item for share in shares for item in share] + list(others)
