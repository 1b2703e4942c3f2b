"""What the check has found: a finding for each assumption of the gateway about the mount, with its verdict.

A finding contains the measured and the assumed value, sentences for the owner, and the keys of gateway.toml that
adapt the gateway to a difference. They are saved in a file from one session to the next. Another file is for the
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

#: The verdicts.
SAME, DIFFERS, NOT_TRIED, NOT_MEASURABLE = "same", "differs", "not tried", "not measurable"


class MeasuredRate(Struct, frozen=True):
    """The assumed and the real rate of an axis, negative if reversed; and the run-on after each stop, degrees, empty if
    the axis hardly moved. The rate is exact only if the mount moved ``evenly``.
    """

    axis: int
    assumed: float
    real: float
    run_ons: tuple[float, ...]
    evenly: bool

    @property
    def rounded(self) -> MeasuredRate:
        """The same rounded to 0.04"/s and 0.01°: more digits might reveal where the mount pointed."""
        run_ons = tuple(round(way, 2) for way in self.run_ons)
        return MeasuredRate(self.axis, round(self.assumed, 5), round(self.real, 5), run_ons, self.evenly)


class Finding(Struct, frozen=True, omit_defaults=True):
    """One comparison. ``means``: what a difference means for the owner; ``keys``: the settings that adapt to it."""

    what: str
    verdict: str
    measured: str = ""
    assumed: str = ""
    means: str = ""
    keys: dict[str, object] = {}
    rate: MeasuredRate | None = None

    @property
    def line(self) -> str:
        """The finding in one line, without its consequence."""
        beside = f": {self.measured}" if self.measured else ""
        return f"{self.verdict}  {self.what}{beside}{f' (assumed: {self.assumed})' if self.assumed else ''}"


def rest_of(stage: str) -> str:
    """Return the name of the untried rest of a stage that ended early."""
    return f"the rest of {stage}"


class StageReporter(Protocol):
    """Takes the findings and the progress of a stage; ``before`` are its findings of an earlier, unfinished run."""

    before: list[Finding]

    def add(self, finding: Finding) -> None: ...
    def progress(self, done_count: int, total: int, title: str) -> None: ...


class Findings(Struct):
    """All findings by stage. ``mount`` is its identity; its ``model`` and ``version`` name the output file."""

    mount: str = ""
    model: str = ""
    version: str = ""
    equatorial: bool = False
    stages: dict[str, list[Finding]] = {}

    def whole(self, stage: str) -> bool:
        """Whether a stage is complete."""
        return stage in self.stages and all(finding.what != rest_of(stage) for finding in self.stages[stage])

    def of(self, verdict: str) -> list[Finding]:
        return [finding for stage in self.stages.values() for finding in stage if finding.verdict == verdict]

    @property
    def keys(self) -> dict[str, object]:
        """The keys of [mount] that adapt the gateway to what differs."""
        return {key: value for finding in self.of(DIFFERS) for key, value in finding.keys.items()}


def load(path: Path) -> Findings:
    """Return the findings of earlier sessions; empty if there is no file, or if it cannot be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Findings)
    except (OSError, msgspec.DecodeError):
        return Findings()


def save(path: Path, findings: Findings) -> None:
    """Write the findings. Raises OSError."""
    path.touch(0o600)  # it tells the mount's site
    path.write_bytes(msgspec.json.format(msgspec.json.encode(findings), indent=1))


class ProofFile(Struct, frozen=True):
    """The file that a check makes: the mount's identity, the version of the gateway, and the findings by stage.

    It omits texts that may reveal a place, a time or a name: the sky stage, and reasons for untried parts.
    """

    mount: str
    firmware: str
    equatorial: bool
    gateway: str
    simulated: bool
    stages: dict[str, list[Finding]]


def result(findings: Findings, simulated: bool) -> ProofFile:
    """Return the part of the findings that others may read."""

    def shown(stage: str, finding: Finding) -> Finding:
        if stage == "sky" or finding.verdict == NOT_TRIED:
            return Finding(finding.what, finding.verdict)
        return replace(finding, rate=None if finding.rate is None else finding.rate.rounded)

    stages = {stage: [shown(stage, finding) for finding in of_stage] for stage, of_stage in findings.stages.items()}
    return ProofFile(findings.mount, findings.version, findings.equatorial, version(), simulated, stages)


def write(folder: Path, findings: Findings, simulated: bool) -> Path:
    """Write the file ``prove-MODEL-VERSION.json`` into a folder, and return its path. Raises OSError."""
    name = f"prove-{findings.model or 'unknown'}-{findings.version or 'unknown'}"
    path = folder / (re.sub(r"[^\w.-]+", "_", name) + ".json")
    path.write_bytes(msgspec.json.format(msgspec.json.encode(result(findings, simulated)), indent=1) + b"\n")
    return path
