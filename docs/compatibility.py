"""Writes docs/compatibility.md: every mount that has been checked, by the files in docs/checked, and how far.

``python docs/compatibility.py`` writes it; a test compares. What has taken part is said as it is: a file that is marked
``simulated`` comes from a simulated mount, and a conversation of a program is no mount at all.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import msgspec

from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME, ProofFile

ROOT = Path(__file__).resolve().parent.parent
PAGE, CHECKED = ROOT / "docs" / "compatibility.md", ROOT / "docs" / "checked"
TRANSCRIPTS = ROOT / "tests" / "conformance" / "transcripts"
HEAD = """\
# Mounts that were checked

<!-- python docs/compatibility.py writes this page -->

Each row of the first table is a file that [`mount-gateway prove`](prove.md) has written; they are in `docs/checked`.

{honest}

| mount | firmware | checked by | gateway | same | differs | not measurable | not tried |
|---|---|---|---|---|---|---|---|
"""
REST = """
## Programs

These programs take part with conversations typed from their source code and from public recordings, not with a mount:
{programs}.
"""


def results() -> list[ProofFile]:
    """Return what the files tell."""
    return [msgspec.json.decode(path.read_bytes(), type=ProofFile) for path in sorted(CHECKED.glob("*.json"))]


def rows() -> Iterator[str]:
    for result in results():
        counts = Counter(finding.verdict for stage in result.stages.values() for finding in stage)
        told = [str(counts[verdict]) for verdict in (SAME, DIFFERS, NOT_MEASURABLE, NOT_TRIED)]
        by, mount = "a simulation" if result.simulated else "an owner", result.mount.removesuffix(result.firmware)
        yield f"| {' | '.join([mount.strip(), result.firmware, by, result.gateway, *told])} |\n"


def page() -> str:
    """Return the whole page."""
    owners = sum(not result.simulated for result in results())
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
