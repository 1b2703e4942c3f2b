"""The file of a check tells nothing of where and when the mount was checked, and nothing that the mount has sent."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from gateway.app.simulated import DEFAULT_SITE
from gateway.diagnostics.prove.findings import DIFFERS, NOT_TRIED, Finding, Findings, MeasuredRate, write_proof_file
from tests.support.prove_setup import EVENING, KINDS, Proven, checked

#: Another site under the same sky, and when that is so some weeks later.
SITE, DAY = (52.37, -71.31), 86164.0905
LATER = EVENING + (DEFAULT_SITE[1] - SITE[1]) / 360.0 * DAY + 20.0 * DAY
#: Names where a person can write one.
NAMES = {"name": "meier's mount", "description": "on obs-pier", "driverinfo": "serial-77341", "siteelevation": 1234.5}
NUMBER = re.compile(r"\d+(?:\.\d+)?")
#: By how much a measured value may differ from one check to the next; any part of a site, date or hour differs by more.
MEASURED = 0.25
#: A shorter reply may be found in any text.
LONG = 6


def elsewhere(mount: str) -> dict[str, Any]:
    """Return the settings of a simulated mount at the other site, with names of its own."""
    zone = {} if mount.startswith("alpaca") else {"utc_offset": -5.0}
    return {"site": SITE, "start": LATER, "config": {"name": "obs-pier", "state": "/home/meier/s"}} | zone


def prepare(replies: set[bytes], proven: Proven) -> None:
    """Give the mount names, and collect what it sends."""
    if hasattr(proven.sim, "names"):
        proven.sim.names[0] = "hilltop"
    if hasattr(proven.sim, "answers"):
        proven.sim.tells |= NAMES
    proven.gateway.wire_log.sinks.append(
        lambda entry: replies.add(entry.data) if (entry.side, entry.arrow) == ("mount", "<") else None
    )


@pytest.mark.sampled(every=4)
@pytest.mark.parametrize("mount", KINDS)
def test_prove_file_does_not_depend_on_the_site_or_the_date(mount: str, tmp_path: Path) -> None:
    replies = set[bytes]()
    here = write_proof_file(tmp_path, checked(mount, (9,)), simulated=True).read_text("utf-8")
    findings = checked(mount, (9,), change=partial(prepare, replies), **elsewhere(mount))
    there = write_proof_file(tmp_path, findings, simulated=True).read_text("utf-8")
    assert NUMBER.sub("…", here) == NUMBER.sub("…", there)
    numbers = zip(NUMBER.findall(here), NUMBER.findall(there), strict=True)
    assert not [pair for pair in numbers if abs(float(pair[0]) - float(pair[1])) > MEASURED]
    assert "goto of 5°" in there and len(replies) > 10
    known = findings.mount.encode()
    sent = [one for one in (reply.rstrip(b"#\n") for reply in replies) if len(one) >= LONG and one not in known]
    assert sent and not [one for one in sent if one.decode("latin-1") in there]


def test_prove_file_leaves_out_text_that_may_reveal_a_place_or_address(tmp_path: Path) -> None:
    findings = Findings("Celestron NexStar 6-8se 4.21", "6-8se", "4.21")
    findings.stages = {
        "sky": [
            Finding("the mount and the settings", DIFFERS, "the mount stands at 52.4 N 71.3 W", means="Correct it.")
        ],
        "motions": [
            Finding("rate 9 west/east", DIFFERS, rate=MeasuredRate(1, 5.0, 4.123456789, (1.23456789,), True)),
            Finding("the rest of motions", NOT_TRIED, "another program moves the mount (192.168.1.7)"),
        ],
    }
    written = write_proof_file(tmp_path, findings, simulated=False).read_text("utf-8")
    assert "the mount and the settings" in written and "the rest of motions" in written
    assert not [words for words in ("52", "71.3", "192.168", "Correct", "4.123456", "1.234") if words in written]
