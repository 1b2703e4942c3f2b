"""Writes docs/compatibility.md: every mount that has been checked, by the bundles in tests/owners, and how far.

``python docs/compatibility.py`` writes it; a test compares. What has taken part is said as it is: a bundle whose ``by``
is ``simulated`` comes from a simulated mount, and a conversation of a program is no mount at all.
"""

from __future__ import annotations

import sys
import zipfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec

from gateway.diagnostics.prove.bundle import VERDICTS, Bundle

ROOT = Path(__file__).resolve().parent.parent
PAGE, OWNERS = ROOT / "docs" / "compatibility.md", ROOT / "tests" / "owners"
TRANSCRIPTS = ROOT / "tests" / "conformance" / "transcripts"
SIMULATED = "simulated"
HEAD = """\
# Mounts that were checked

<!-- python docs/compatibility.py writes this page -->

Each row of the first table is a file that [`mount-gateway prove`](prove.md) has made. Every version of the gateway has
to replay it.

{honest}

| mount | firmware | program | checked by | when | same | differs | not measurable | not tried |
|---|---|---|---|---|---|---|---|---|
"""
REST = """
## Programs

These programs take part with conversations typed from their source code and from public recordings, not with a mount:
{programs}.
"""


def bundles() -> list[Bundle]:
    """Return the verdicts of all bundles."""
    found = []
    for path in sorted(OWNERS.glob("*.zip")):
        with zipfile.ZipFile(path) as archive:
            found.append(msgspec.json.decode(archive.read(VERDICTS), type=Bundle))
    return found


def rows() -> Iterator[str]:
    for bundle in bundles():
        findings = bundle.findings
        counts = Counter(finding.verdict for stage in findings.stages.values() for finding in stage)
        told = [str(counts[verdict]) for verdict in ("same", "differs", "not measurable", "not tried")]
        by = "a simulation" if bundle.by == SIMULATED else bundle.by or "an owner"
        first = (findings.mount.removesuffix(findings.version).strip(), findings.version, "prove", by, bundle.month)
        yield f"| {' | '.join([*first, *told])} |\n"


def page() -> str:
    """Return the whole page."""
    owners = sum(bundle.by != SIMULATED for bundle in bundles())
    honest = (
        f"{owners} of these mounts are real."
        if owners
        else "**None of these mounts is real** so far: all are simulated."
    )
    programs = sorted(path.stem for path in TRANSCRIPTS.glob("*.txt"))
    return (
        HEAD.format(honest=honest) + "".join(rows()) + REST.format(programs=", ".join(f"`{one}`" for one in programs))
    )


if __name__ == "__main__":
    sys.stdout.write(f"wrote {PAGE.write_text(page(), 'utf-8')} characters\n")
