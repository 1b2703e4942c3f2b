"""Whatever is decoded: little memory, little output for what is no conversation; how captures are cut into commands."""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

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


@pytest.mark.skipif(sys.platform != "linux", reason="the system tells the memory there")
def test_megabytes_of_junk_take_little(tmp_path: Path) -> None:
    path, program = tmp_path / "junk", tmp_path / "decode.py"
    path.write_bytes(Random(1).randbytes(5_000_000))
    program.write_text(PROGRAM)
    done = run_to_end(str(program), str(path))
    *said, last = done.stderr.splitlines()
    first, second, grown = map(int, last.split())
    assert (done.returncode, first, second) == (0, 2, 2)
    assert len(said) == 2
    assert all("no conversation in the" in words and "name that with --protocol" in words for words in said)
    assert grown < 3_000
    assert len(done.stdout) < 250_000


@pytest.mark.parametrize("text", ["# Title\n\nWords: some of them, and more.\n" * 40, "e t z\nJ L\n" * 400])
def test_a_text_file_is_no_capture(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "README.md"
    path.write_text(text)
    code, lines, errors = _decode(capsys, str(path))
    assert (code, lines) == (2, [])
    assert "this is text, and no capture" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize("sent", [b":GR#:GD#:Sr 05:34:32#\r\n:MS#\r\n" * 3, b"#:GR#", b"eeztJ", b"\x06:GVP#"])
def test_bare_bytes_of_a_client_are_decoded(sent: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "capture"
    path.write_bytes(sent)
    code, lines, errors = _decode(capsys, str(path))
    assert (code, errors) == (0, "")
    assert not any("no command" in line for line in lines)


def test_what_is_repeated_without_times_is_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "capture"
    path.write_bytes(b":GR#" * 5000 + b":GD#:GD#")
    code, lines, _ = _decode(capsys, str(path))
    assert code == 0
    assert [" ".join(line.split()[2:3]) for line in lines] == [":GR#", "4999", ":GD#", ":GD#"]
    assert lines[1].strip() == "the same 4999 times more"


def test_a_spy_log_and_a_socat_log_are_read_line_by_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


def test_a_client_that_sends_noise_is_counted_in_a_recording(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "night.rec"
    config = '{"mount": {"at": "lx200@sim"}, "surface": [{"at": "lx200@tcp://:0"}]}'
    head = (
        f'# mount-gateway recording 1\n# {{"began": 0, "from": 0, "config": {config}}}\n'
        "0.1 10.0.0.1:1 + surface 1, host 10.0.0.1\n"
    )
    path.write_text(head + "0.2 10.0.0.1:1 > :noise#\n" * 3000 + "0.3 10.0.0.1:1 > :GR#\n0.4 10.0.0.1:1 -\n")
    code, lines, _ = _decode(capsys, str(path))
    assert code == 0
    assert len(lines) == 1 + 1000 + 1 + 1 + 1 + 1
    assert "2000 more unknown commands" in lines[-3]
    assert ":GR#" in lines[-4]
    assert "the gateway was killed or still runs" in lines[-1]


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
