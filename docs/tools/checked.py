"""The table of checked mounts in docs/prove.md: one row a file in docs/checked, which ``prove`` has written.

``docs/tools/tables.py`` writes it. A file that is marked ``simulated`` comes from a simulated mount; its row says so.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import msgspec

from gateway.diagnostics.prove.findings import DIFFERS, NOT_MEASURABLE, NOT_TRIED, SAME, ProofFile

CHECKED = Path(__file__).resolve().parents[1] / "checked"
_HEAD = """\
{real}

| mount | firmware | checked by | gateway | same | differs | not measurable | not tried |
|---|---|---|---|---|---|---|---|
"""


def checked_table() -> str:
    """Return the sentence that counts the real mounts, and the table."""
    results = [msgspec.json.decode(path.read_bytes(), type=ProofFile) for path in sorted(CHECKED.glob("*.json"))]
    owners = sum(not result.simulated for result in results)
    real = f"**{owners} of these mounts are real.**" if owners else "**No real mount so far**: all are simulated."
    return _HEAD.format(real=real) + "".join(map(_row, results))


def _row(result: ProofFile) -> str:
    counts = Counter(finding.verdict for stage in result.stages.values() for finding in stage)
    numbers = [str(counts[verdict]) for verdict in (SAME, DIFFERS, NOT_MEASURABLE, NOT_TRIED)]
    by, mount = "a simulation" if result.simulated else "an owner", result.mount.removesuffix(result.firmware)
    return f"| {' | '.join([mount.strip(), result.firmware, by, result.gateway, *numbers])} |\n"
