"""The bundle of a check: one file that anybody may have, with its verdicts and its anonymous recordings."""

from __future__ import annotations

import re
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import count
from math import inf
from pathlib import Path
from random import Random

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from gateway.app.config import parse_endpoint
from gateway.app.recording.format import RECORDER, Event, read, unescape
from gateway.core.errors import UserError
from gateway.core.wire_log import MOUNT
from gateway.diagnostics.log.conversation import Side
from gateway.diagnostics.prove.anonymous import anonymous, header, written
from gateway.diagnostics.prove.elsewhere import elsewhere, same_site, site_of
from gateway.diagnostics.prove.findings import NOT_TRIED, Finding, Findings
from gateway.diagnostics.replay.replaying import outputs, replay

#: The name of the verdicts in a bundle, and the date of its files.
VERDICTS, DATE = "verdicts.json", (1980, 1, 1, 0, 0, 0)


class Played(Struct, frozen=True):
    """What a recording gave when it was replayed: connections, replies, requests; how many of these differed."""

    clients: int
    replies: int
    requests: int
    differences: int
    strayed: int


class Bundle(Struct, frozen=True):
    """``month`` is when the check was; ``by`` a name that the owner has allowed to be told, or ``simulated``."""

    findings: Findings
    month: str
    version: str
    by: str = ""
    played: dict[str, Played] = {}


def played(path: Path) -> Played:
    """Replay a recording. Raises UserError."""
    outcome = replay(read(path))
    return Played(outcome.clients, outcome.replies, outcome.requests, len(outcome.differences), len(outcome.strayed))


def public(findings: Findings) -> Findings:
    """Return the findings without what may tell a place or a name: all words of the sky, and why something ended."""

    def shown(stage: str, finding: Finding) -> Finding:
        hidden = stage == "sky" or finding.verdict == NOT_TRIED
        return Finding(finding.what, finding.verdict) if hidden else finding

    stages = {stage: [shown(stage, one) for one in found] for stage, found in findings.stages.items()}
    return replace(findings, stages=stages, told={})


def name_of(findings: Findings) -> str:
    """Return ``prove-MODEL-VERSION.zip``."""
    return re.sub(r"[^\w.-]+", "_", f"prove-{findings.model or 'unknown'}-{findings.version or 'unknown'}") + ".zip"


def unused(name: str) -> Path:
    """Return a path here for a file of this name, with a number if there is one already."""
    path = Path(name)
    names = (path.with_stem(f"{path.stem}-{number}") for number in count(2))
    return path if not path.exists() else next(one for one in names if not one.exists())


def make(
    findings: Findings, recordings: Sequence[Path], by: str = "", random: Random | None = None
) -> dict[str, bytes]:
    """Return the files of a bundle by name, in their order. Raises UserError if something cannot be hidden."""
    files: dict[str, bytes] = {}
    outcomes: dict[str, Played] = {}
    month = version = ""
    if not recordings:
        raise UserError("nothing is recorded yet: the stages from place to program are")
    originals = [read(path) for path in recordings]
    told = [site_of(recording, findings.model) for recording in originals]
    known = [(site, zone) for site, zone in told if site is not None]
    if any(not same_site(known[0][0], site) for site, _ in known):
        raise UserError("it was checked at several sites: delete the folder, and check it at one")
    site, zone = (known or told)[0]
    there = elsewhere(site, zone, originals[0].settings["began"], random)
    with tempfile.TemporaryDirectory() as folder:
        for number, recording in enumerate(originals, 1):
            hidden = Path(folder) / f"{number}.rec"
            settings = header(recording.settings, there)
            events = anonymous(recording, there, findings.equatorial, findings.model)
            hidden.write_bytes(written(settings, events))
            side = Side(parse_endpoint(settings["config"]["mount"]["at"]).protocol, findings.model)
            end = _goes_another_way(replay(read(hidden)).strayed, side)
            events = [event for event in events if event.at < end or (event.side, event.arrow) == (RECORDER, "!")]
            hidden.write_bytes(written(settings, events))
            files[hidden.name] = written(settings, _with_outputs(events, outputs(read(hidden))))
            hidden.write_bytes(files[hidden.name])
            outcomes[hidden.name] = played(hidden)
            month, version = f"{datetime.fromtimestamp(settings['began'], UTC):%Y-%m}", str(settings["version"])
    bundle = Bundle(public(findings), month, version, by, outcomes)
    return {VERDICTS: msgspec.json.format(msgspec.json.encode(bundle), indent=1), **files}


def _goes_another_way(strayed: Sequence[str], side: Side) -> float:
    """Return when the gateway sends another command than it did at the true latitude, not only another value."""
    for line in strayed:
        at, now, then = re.fullmatch(r"([\d.]+) s: asked '(.*)', then '(.*)'", line, re.DOTALL).groups()  # type: ignore[union-attr]
        if side.command(unescape(now)).command != side.command(unescape(then)).command:
            return float(at)
    return inf


def _with_outputs(events: Sequence[Event], after: dict[int, list[Event]]) -> Iterator[Event]:
    """Yield the inputs of a recording, each turn followed by what the gateway now sends."""
    turns = sorted(after)
    for event in events:
        if event.arrow == "t" or (event.side, event.arrow) == (RECORDER, "!"):
            while turns and (event.arrow != "t" or turns[0] < int(event.data)):
                yield from after[turns.pop(0)]
        if event.arrow != (">" if event.side == MOUNT else "<"):
            yield event


def save(path: Path, files: dict[str, bytes]) -> None:
    """Write a bundle; its files bear no date. Raises OSError."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, DATE), data, zipfile.ZIP_DEFLATED)


def load(path: Path, folder: Path) -> Bundle:
    """Unpack a bundle into a folder and return its verdicts."""
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            if name == VERDICTS or re.fullmatch(r"\d+\.rec", name):
                (folder / name).write_bytes(archive.read(name))
    return msgspec.json.decode((folder / VERDICTS).read_bytes(), type=Bundle)
