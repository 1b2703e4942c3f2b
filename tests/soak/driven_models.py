"""Performs every operation on every driven model and version; the expectations are those of the test of that name.

python -m tests.soak.driven_models
"""

from __future__ import annotations

import sys

from gateway.diagnostics.virtual_time import run
from tests.integration.test_driven_models import MEADE, NEXSTAR, wrong
from tests.support.operations_matrix import outcomes


def main() -> int:
    """Return 0 if everything is as the tables say, else 1."""
    differ = count = 0
    mounts = [("lx200", model, None, row) for model, row in MEADE.items()]
    mounts += [("nexstar", model, version, row) for model, rows in NEXSTAR.items() for version, row in rows.items()]
    for protocol, model, version, row in mounts:
        found = run(outcomes(protocol, model, version))
        count += len(found)
        for name, (seen, said) in wrong(found, row).items():
            print(f"{protocol}:{model} {version or ''} {name}: {seen}, the table says {said}")
            differ += 1
    print(f"{len(mounts)} mounts, {count} operations, {differ} differ from the tables")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main())
