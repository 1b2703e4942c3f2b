"""The findings of ``prove``: one for each assumption of the gateway about the mount, with a verdict.

A finding contains the measured and the assumed value, sentences for the owner, and the keys of gateway.toml that
adapt the gateway to a difference. Findings are saved in a file from one session to the next. Another file is for the
maintainers of the gateway: it has verdicts and measured values, and nothing that reveals a place or a time.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Protocol

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from gateway.core.about import version

#: The verdicts of a finding.
SAME, DIFFERS, NOT_TRIED, NOT_MEASURABLE = "same", "differs", "not tried", "not measurable"


class MeasuredRate(Struct, frozen=True):
    """The assumed and the real rate of an axis, degrees a second (real: negative if reversed), and the run-on after
    each stop, degrees (empty if the axis hardly moved). The rate is exact only if the axis moved ``evenly``.
    """

    axis: int
    assumed: float
    real: float  # the measured rate
    run_ons: tuple[float, ...]  # motion after each stop, degrees
    evenly: bool  # at constant speed, so that the rate is exact

    @property
    def rounded(self) -> MeasuredRate:
        """This rate rounded to 0.04"/s and 0.01°: more digits might reveal where the mount pointed."""
        run_ons = tuple(round(way, 2) for way in self.run_ons)
        return MeasuredRate(self.axis, round(self.assumed, 5), round(self.real, 5), run_ons, self.evenly)


class Finding(Struct, frozen=True, omit_defaults=True):
    """The verdict on an assumption of the gateway about the mount. If the mount differs, the finding has a sentence
    about the effect (``means``) and, if there are any, keys of gateway.toml that adapt the gateway.
    """

    what: str  # what was compared with the assumption
    verdict: str
    measured: str = ""
    assumed: str = ""
    means: str = ""  # the effect of a difference, for the owner
    keys: dict[str, object] = {}  # keys of gateway.toml that adapt the gateway
    rate: MeasuredRate | None = None

    @property
    def as_line(self) -> str:
        """The finding in one line, without the sentence about its effect."""
        beside = f": {self.measured}" if self.measured else ""
        return f"{self.verdict}  {self.what}{beside}{f' (assumed: {self.assumed})' if self.assumed else ''}"


def untried_rest_title(stage: str) -> str:
    """Return the title of the finding for the parts that were not tried because a stage ended early."""
    return f"the rest of {stage}"


class StageReporter(Protocol):
    """Receives findings and progress of a stage. ``old_findings``: those of an earlier session in the same stage."""

    old_findings: list[Finding]

    def add(self, finding: Finding) -> None: ...
    def progress(self, done_count: int, total: int, title: str) -> None: ...


class Findings(Struct):
    """All findings, by stage. ``mount`` is the mount's identity; model and version become part of a file name."""

    mount: str = ""
    model: str = ""
    version: str = ""
    equatorial: bool = False
    stages: dict[str, list[Finding]] = {}

    def is_complete(self, stage: str) -> bool:
        """Whether a stage was carried out to its end."""
        return stage in self.stages and all(finding.what != untried_rest_title(stage) for finding in self.stages[stage])

    def select(self, verdict: str) -> list[Finding]:
        return [finding for stage in self.stages.values() for finding in stage if finding.verdict == verdict]

    @property
    def config_keys(self) -> dict[str, object]:
        """The keys of [mount] in gateway.toml that adapt the gateway to all differences."""
        return {key: value for finding in self.select(DIFFERS) for key, value in finding.keys.items()}


def load(path: Path) -> Findings:
    """Return the findings of earlier sessions; empty if there is no file, or if it cannot be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Findings)
    except (OSError, msgspec.DecodeError):
        return Findings()


def save(path: Path, findings: Findings) -> None:
    """Save the findings for the next session. Raises OSError."""
    path.touch(0o600)  # for the owner only: the findings reveal the site
    path.write_bytes(msgspec.json.format(msgspec.json.encode(findings), indent=1))


class ProofFile(Struct, frozen=True):
    """The content of the file for the maintainers: mount, version of the gateway, and findings by stage.

    It omits texts that may reveal a place, a time or a name: those of the sky stage, and reasons for untried parts.
    """

    mount: str
    firmware: str
    equatorial: bool
    gateway: str
    simulated: bool
    stages: dict[str, list[Finding]]


def public_findings(findings: Findings, simulated: bool) -> ProofFile:
    """Return the findings without anything private."""

    def redact(stage: str, finding: Finding) -> Finding:
        if stage == "sky" or finding.verdict == NOT_TRIED:
            return Finding(finding.what, finding.verdict)
        return replace(finding, rate=None if finding.rate is None else finding.rate.rounded)

    stages = {stage: [redact(stage, finding) for finding in of_stage] for stage, of_stage in findings.stages.items()}
    return ProofFile(findings.mount, findings.version, findings.equatorial, version(), simulated, stages)


def write_proof_file(folder: Path, findings: Findings, simulated: bool) -> Path:
    """Write the file ``prove-MODEL-VERSION.json`` into a folder, and return its path. Raises OSError."""
    name = f"prove-{findings.model or 'unknown'}-{findings.version or 'unknown'}"
    path = folder / (re.sub(r"[^\w.-]+", "_", name) + ".json")
    path.write_bytes(msgspec.json.format(msgspec.json.encode(public_findings(findings, simulated)), indent=1) + b"\n")
    return path
