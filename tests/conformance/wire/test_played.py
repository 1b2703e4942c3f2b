"""``played.toml`` says what plays show; a row or a function that has changed is played again, and no other."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from gateway.core.tables import mappings_folder
from gateway.diagnostics import command_tables
from gateway.diagnostics.rehearsal import played
from gateway.protocols.registry import surfaces
from gateway.protocols.wireformat.command_set import load
from tests.support.sampling import as_a_rule

ROWS = [(protocol, name) for protocol in surfaces() for name in load(protocol).surface]


@pytest.mark.parametrize("first", range(8))
def test_a_row_does_what_was_written_down(first: int) -> None:
    for protocol, name in ROWS[first * as_a_rule(2, whole=1) :: as_a_rule(16, whole=8)]:
        row = load(protocol).played[name]
        assert replace(played.play_row(protocol, name), of=row.of) == row, name


def test_only_what_has_changed_is_stale(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert list(played.stale()) == []
    row = load("lx200").played["Gr"]
    monkeypatch.setitem(load("lx200").played, "Gr", replace(row, of="an older one"))
    assert list(played.stale()) == [("lx200", "Gr")]
    assert command_tables.check() == 1
    assert "mappings/lx200/played.toml: [Gr]: its row or function has changed" in capsys.readouterr().err


def test_a_changed_function_is_played_again(tmp_path: Path) -> None:
    shutil.copytree(mappings_folder(), tmp_path / "mappings")
    shutil.copytree(mappings_folder().parent / "gateway", tmp_path / "gateway")
    helper = tmp_path / "gateway/protocols/lx200/surface/accessories.py"
    before = 'return b""\n\n\n# --- help'
    assert before in helper.read_text("utf-8")
    helper.write_text(helper.read_text("utf-8").replace(before, 'return b"0#"\n\n\n# --- help'), "utf-8")

    def tables(flag: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "gateway", "tables", flag]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)

    stale = tables("--check")
    assert stale.returncode == 1
    changed = [name for name, row in load("lx200").surface.items() if row.call == "accessories.silence"]
    assert len(changed) > 2 and all(f"lx200/played.toml: [{name}]: " in stale.stderr for name in changed)
    assert tables("--write").stdout.startswith(f"played {len(changed)} rows, wrote ")
    rows = (tmp_path / "mappings/lx200/played.toml").read_text("utf-8").splitlines()
    assert next(line for line in rows if line.startswith("fT = ")).startswith('fT = { outcome = "synthesised", ')
    assert tables("--check").returncode == 0
