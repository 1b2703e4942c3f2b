"""Makes the bundles of simulated mounts, one of each kind: ``python -m tests.owners.simulated``."""

from __future__ import annotations

import tempfile
from pathlib import Path
from random import Random
from unittest.mock import patch

from gateway.diagnostics.prove import bundle, small_motions
from gateway.diagnostics.prove.findings import Findings
from tests.support.proven import Onlooker, Proven, run_calm

FOLDER = Path(__file__).parent
#: One mount of each kind: Celestrons with old and new hand controls, two of SynScan, the four Meades, three
#: controllers that speak LX200 with words of their own, and the three kinds of Alpaca.
KINDS = (
    "nexstar:6-8se",
    "nexstar:nexstar-gps/2.2",
    "nexstar:cgem",
    "nexstar:avx/starsense-1.19",
    "nexstar:synscan",
    "nexstar:synscan-az",
    "lx200:lx200",
    "lx200:lx200-16",
    "lx200:autostar",
    "lx200:lx200gps",
    "lx200:onstep",
    "lx200:teenastro",
    "lx200:other",
    "alpaca:german",
    "alpaca:altaz",
    "alpaca:polar",
)
SITE = (47.3, 11.6)


def make(mount: str, target: Path) -> None:
    """Check a simulated mount and save its bundle."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "1.rec"

        async def check() -> Findings:
            async with Proven(mount, site=SITE, every=9.0) as looked:
                findings = await looked.check(Onlooker("yyq"))
            async with Proven(mount, record=path, site=SITE, every=9.0) as proven:
                proven.findings = findings
                with patch.object(small_motions, "KEYS", (9, 6, 1)):
                    return await proven.check(Onlooker())

        findings: Findings = run_calm(check())
        files = bundle.make(findings, [path], by="simulated", random=Random(mount))
        bundle.save(target / bundle.name_of(findings), files)


if __name__ == "__main__":
    for kind in KINDS:
        make(kind, FOLDER)
