"""The order of a run is drawn by chance, so that no test comes to need what another one has left behind.

The tests of a module stay together, because they share what it sets up, and so do those of the console's page, which
share a browser. Tests that wait for real programs begin first, on most of the workers, while others keep the processor
busy, and long tests begin before short ones: else one long test may be all that is left at the end. The seed is printed
at the end; ``TEST_ORDER=7 pytest`` repeats an order on the same number of workers.
"""

from __future__ import annotations

import os
from random import Random, SystemRandom

import pytest

#: The folder whose tests share a browser and a gateway, and keep their order.
IN_ORDER = "tests/programs/console/"
#: Where tests wait for long and share nothing: each is dealt by itself.
APART = ("tests/programs/test_indi", "tests/programs/test_hamlib", "tests/programs/test_alpaca")
#: Where the tests wait most of their time: for real programs, and for what needs the time of this computer.
WAITING = ("tests/programs/", "tests/unit/app/watchdog/", "tests/integration/stops/test_stop_waits_on_ports.py")
#: Where tests take seconds of the processor.
LONG = ("tests/integration/safety/", "tests/conformance/wire/", "tests/conformance/ascom/")


def seed() -> str:
    """Return the seed of this run, which its worker processes inherit."""
    return os.environ.setdefault("TEST_ORDER", str(SystemRandom().randrange(10_000)))


def shuffled(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests group by group, the groups and their tests in the order of the seed, dealt to the workers."""
    chance, groups = Random(seed()), dict[str, list[pytest.Item]]()
    for item in items:
        path = item.nodeid.partition("::")[0]
        group = IN_ORDER if path.startswith(IN_ORDER) else item.nodeid if path.startswith(APART) else path
        groups.setdefault(group, []).append(item)
    for group, tests in groups.items():
        if group != IN_ORDER:
            chance.shuffle(tests)
    order = list(groups)
    chance.shuffle(order)
    waiting = [groups[group] for group in order if group.startswith(WAITING)]
    long = [groups[group] for group in order if group.startswith(LONG)]
    short = [item for group in order if not group.startswith((*WAITING, *LONG)) for item in groups[group]]
    return dealt(waiting, long, short, int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


def dealt(
    waiting: list[list[pytest.Item]], long: list[list[pytest.Item]], short: list[pytest.Item], workers: int
) -> list[pytest.Item]:
    """Return the tests in an order of which pytest-xdist gives each worker an equal part: five eighths of the workers
    begin with a like number of waiting tests, long tests follow, and short ones fill all parts.
    """
    parts: list[list[pytest.Item]] = [[] for _ in range(workers)]
    for groups, some in ((waiting, parts[: workers * 5 // 8 or 1]), (long, parts)):
        for group in groups:
            min(some, key=len).extend(group)
    left = sum(map(len, parts)) + len(short)
    for number, part in enumerate(parts):
        taken = max(0, left // (workers - number) - len(part))
        part += short[:taken]
        del short[:taken]
        left -= len(part)
    return [item for part in parts for item in part] + short
