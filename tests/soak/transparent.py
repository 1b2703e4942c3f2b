"""Sends 91 requests to every kind of mount, directly and through a gateway of its protocol: how many replies differ?

python -m tests.soak.transparent
"""

from __future__ import annotations

import sys

from gateway.diagnostics.virtual_time import run
from tests.support.transparent import ALLOWED, MOUNTS, asked_of, differences


def main() -> int:
    """Return 0 if no more replies differ than permitted, else 1."""
    worst = 0
    for protocol, model, version in MOUNTS:
        found = run(differences(protocol, model, version))
        worst = max(worst, len(found))
        print(f"{protocol}:{model}{f'/{version}' if version else ''}: {len(found)} of {asked_of(protocol)} differ")
        for item in found:
            print(f"    {item.asked!r}: the mount {item.direct!r}, the gateway {item.shared!r}")
    print(f"at most {worst} differ, {ALLOWED} may")
    return int(worst > ALLOWED)


if __name__ == "__main__":
    sys.exit(main())
