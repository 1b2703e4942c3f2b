"""The table of checked mounts is made from the files of the checks, and says which are simulated."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest

from gateway.diagnostics.prove.findings import ProofFile
from gateway.diagnostics.prove.guide import STAGES
from tests.support.prove_setup import CHECKED, KINDS
from tests.support.scripts import script

FILES = sorted(CHECKED.glob("*.json"))


@pytest.mark.parametrize("file", FILES, ids=lambda path: path.stem)
def test_every_checked_mount_file_matches_the_output_format_of_prove(file: Path) -> None:
    result = msgspec.json.decode(file.read_bytes(), type=ProofFile)
    assert json.loads(file.read_bytes()) == json.loads(msgspec.json.encode(result))
    assert {"reads", "motions", "goto"} <= result.stages.keys() <= {stage.name for stage in STAGES}


def test_table_of_checked_mounts_lists_every_file_and_marks_simulated_ones() -> None:
    table = script("docs/tools/checked.py").checked_table()
    results = [msgspec.json.decode(file.read_bytes(), type=ProofFile) for file in FILES]
    simulated = sum(result.simulated for result in results)
    assert simulated >= len(KINDS) and table.count("| a simulation |") == simulated
    assert table.count("| an owner |") == len(results) - simulated
