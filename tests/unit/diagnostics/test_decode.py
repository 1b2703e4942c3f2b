"""Captures are decoded in little memory, and cut into commands as a surface does it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from gateway.cli import main
from tests.support.process import run_to_end

#: Decodes a file in both protocols, and says last by how much that made its memory grow, in kB.
PROGRAM = """
import sys
from pathlib import Path
from gateway.cli import main

def most():
    return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])

before = most()
codes = [main(["decode", "--protocol", protocol, sys.argv[1]]) for protocol in ("lx200", "nexstar")]
print(*codes, most() - before, file=sys.stderr)
"""


def _decode(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, list[str], str]:
    code = main(["decode", *arguments])
    said = capsys.readouterr()
    return code, said.out.splitlines(), said.err


@pytest.mark.parametrize("content", [b"", b"# Title\n\nWords: some of them, and more.\n", b":GR#:GD#", b"eeztJ"])
def test_decode_refuses_a_file_of_another_kind(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "README.md"
    path.write_bytes(content)
    code, lines, errors = _decode(capsys, str(path))
    assert (code, lines) == (2, []) and "no recording" in errors and len(errors.splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells the memory there")
def test_decode_reads_megabytes_in_little_memory(tmp_path: Path) -> None:
    path, program = tmp_path / "spied", tmp_path / "decode.py"
    path.write_text("000000.100 TX   0000  FF 45 3A 47 52 23                   .E:GR#\n" * 60_000)
    program.write_text(PROGRAM)
    done = run_to_end(str(program), str(path))
    first, second, grown = map(int, done.stderr.splitlines()[-1].split())
    assert (done.returncode, first, second) == (0, 0, 0)
    assert grown < 3_000


def test_decode_reads_spy_and_socat_logs_line_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spy, socat = tmp_path / "spy", tmp_path / "socat"
    spy.write_text(
        "000000.002 TX   0000  3A 47 52 23                                       :GR#\n"
        "000000.020 RX   0000  30 35 3A 33 34 3A 33 32  23                       05:34:32#\n"
    )
    socat.write_text(
        "> 2026/01/15 22:00:00.000100  length=4 from=0 to=3\n 3a 47 52 23\n--\n"
        "< 2026/01/15 22:00:00.020100  length=9 from=0 to=8\n 30 35 3a 33 34 3a 33 32 23\n--\n"
    )
    for path in (spy, socat):
        code, lines, _ = _decode(capsys, str(path))
        assert code == 0
        assert len(lines) == 2
        assert ":GR#" in lines[0] and "GR: RA 05:34:32" in lines[1]


def words(path: Path, data: bytes, capsys: pytest.CaptureFixture[str], protocol: str) -> str:
    path.write_bytes(data)
    assert main(["decode", str(path), "--protocol", protocol]) == 0
    return capsys.readouterr().out


def test_decode_drops_half_a_command_after_a_pause_as_a_surface_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    spied = b"""000000.100 TX   0000  FF 45                                             .E
000000.150 TX   0000  45                                                E
000000.400 TX   0000  4A                                                J
"""
    lines = words(tmp_path / "spied", spied, capsys, "nexstar").splitlines()
    assert len(lines) == 1 and "alignment is complete" in lines[0]


def test_decode_names_a_command_without_its_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spied = b"""000000.100 TX   0000  3A 53 4D 66 6F 6F 3A 4D  6E 23                 :SMfoo:Mn#
000000.110 RX   0000  30                                                0
"""
    lines = words(tmp_path / "spied", spied, capsys, "lx200").splitlines()
    assert len(lines) == 2
    assert ":SMfoo:Mn#" in lines[0] and "missing" in lines[0]
    assert "SM" in lines[1] and "nobody asked" not in lines[1]
