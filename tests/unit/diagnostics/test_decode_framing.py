"""How a capture is cut into commands: by its own times, and where it tells none, so that junk costs one byte."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.cli import main


def words(path: Path, data: bytes, capsys: pytest.CaptureFixture[str], protocol: str) -> str:
    path.write_bytes(data)
    assert main(["decode", str(path), "--protocol", protocol]) == 0
    return capsys.readouterr().out


def test_junk_in_the_bare_bytes_costs_one_byte(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = words(tmp_path / "bare", b"\xffEg34AB0500,12CE0500?R34AB,12CE", capsys, "nexstar")
    lines = told.splitlines()
    assert len(lines) == 3
    assert "right ascension and declination" in lines[0]
    assert "g34AB0500,12CE0500" in lines[1] and "no command of the nexstar protocol" in lines[1]
    assert "goto right ascension and declination" in lines[2]


def test_a_timed_capture_is_cut_as_the_surface_does(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spied = b"""000000.100 TX   0000  FF 45                                             .E
000000.150 TX   0000  45                                                E
000000.400 TX   0000  4A                                                J
"""
    lines = words(tmp_path / "spied", spied, capsys, "nexstar").splitlines()
    assert len(lines) == 1 and "alignment is complete" in lines[0]


def test_a_command_without_its_end_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spied = b"""000000.100 TX   0000  3A 53 4D 66 6F 6F 3A 4D  6E 23                 :SMfoo:Mn#
000000.110 RX   0000  30                                                0
"""
    lines = words(tmp_path / "spied", spied, capsys, "lx200").splitlines()
    assert len(lines) == 2
    assert ":SMfoo:Mn#" in lines[0] and "missing" in lines[0]
    assert "SM" in lines[1] and "nobody asked" not in lines[1]
