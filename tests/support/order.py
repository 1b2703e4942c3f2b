"""The order of a run: modules of tests that wait for real programs lie between those that keep a processor busy.

One after the other they would keep two processors busy for half of the run and idle for the rest of it. The tests of a
module stay together, because they share what it sets up.
"""

from __future__ import annotations

from itertools import groupby

import pytest

#: The folder whose tests mostly wait.
WAITING = "tests/programs/"


def mixed(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests with the modules of real programs spread evenly over the run, else in their order."""
    modules = [(path, list(tests)) for path, tests in groupby(items, lambda item: item.nodeid.partition("::")[0])]
    busy = sum(len(tests) for path, tests in modules if not path.startswith(WAITING))
    waiting = sum(len(tests) for path, tests in modules if path.startswith(WAITING))
    placed: list[tuple[float, list[pytest.Item]]] = []
    before = {False: 0, True: 0}
    for path, tests in modules:
        waits = path.startswith(WAITING)
        placed.append((before[waits] / max(1, waiting if waits else busy), tests))
        before[waits] += len(tests)
    return [test for _, tests in sorted(placed, key=lambda one: one[0]) for test in tests]
