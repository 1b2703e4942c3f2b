"""What TOML or a command line allows and nobody means: one line with its place, no traceback, nothing on the terminal
but text.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.app.config import make_config, read_tables
from gateway.cli import main
from gateway.core.errors import UserError
from tests.support.each import each

SURFACE = '[[surface]]\nat = "lx200@tcp://:0"\n'
MOUNT = '[mount]\nat = "nexstar@sim"\n'
NUL, ESCAPE = "\\u0000", "\\u001b"


@each(
    ("text", "line", "says"),
    [
        (f"{MOUNT}lowest = {'9' * 5000}\n{SURFACE}", 3, "this number has thousands of digits"),
        (f"{MOUNT}lowest = 0x{'f' * 5000}\n{SURFACE}", 3, "write a number from -90 to 90"),
        (f"{MOUNT}baud = 0x{'f' * 5000}\n{SURFACE}", 3, "baud: this number: write a whole number"),
        (f"{MOUNT}site = [0x{'f' * 5000}, 1.0]\n{SURFACE}", 3, "site: this number: write [a number"),
        (f"{MOUNT}site = {'[' * 100_000}{']' * 100_000}\n{SURFACE}", 3, "this is nested too deep"),
        (f"{MOUNT}\nx = {'{a=' * 1000}1{'}' * 1000}\n{SURFACE}", 4, "this is nested too deep"),
        (f"{MOUNT}{SURFACE}[{'a.' * 20_000}a]\n", 5, "this is nested too deep"),
        (f'{MOUNT}state = "a{NUL}b"\n{SURFACE}', 3, "[mount] state"),
        (f'{MOUNT}record = "a{NUL}b"\n{SURFACE}', 3, "[mount] record: there is a control character"),
        (f'[mount]\nat = "nexstar@/dev/tty{NUL}"\n{SURFACE}', 2, "[mount] at: there is a control character"),
        (f'{MOUNT}[[surface]]\nat = "lx200@pty:/tmp/a{NUL}"\n', 4, "[[surface]] at: there is a control character"),
        (f'{MOUNT}[[surface]]\nat = "lx200@tcp://a{NUL}:1"\n', 4, "[[surface]] at: there is a control character"),
        (f'{MOUNT}{SURFACE}allow = ["::1", "a{ESCAPE}[2J"]\n', 5, "[[surface]] allow: there is a control character"),
        (f'{MOUNT}"a{ESCAPE}[2J" = 1\n{SURFACE}', 3, "there is no such key"),
        (f"{MOUNT}[[surface]]\nat = 'lx200@tcp://127.0.0.1:{'9' * 5000}'\n", 4, "a port is a number from 0"),
        (f"{MOUNT}[[surface]]\nat = 'lx200@tcp://127.0.0.1:\N{SUPERSCRIPT TWO}'\n", 4, "write tcp://HOST:PORT"),
    ],
)  # fmt: skip
def test_malformed_config_value_is_reported_in_one_line_with_its_line_number(
    text: str, line: int, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(UserError) as told:
        make_config(*read_tables(path))
    assert str(told.value).startswith(f"{path}:{line}: ")
    assert says in str(told.value)


@each(
    "words",
    [
        ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://:0", "--baud", "9" * 5000],
        ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://:0", "--lowest", "9" * 5000],
        ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://:0", "--state", "a\x1b[2Jb"],
        ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://:0", "--record", "a\0b"],
        ["run", "--mount", "nexstar@\x1b[2J", "--surface", "lx200@tcp://:0"],
        ["run", "--mount", "nexstar@sim", "--surface", f"lx200@tcp://{'a' * 70}:0"],
        ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://a..b:0"],
        ["run", "--config", "no\x1b[2Jfile"],
        ["sim", "nexstar", "--at", "tcp://a..b:0"],
        ["sim", "nexstar", "--speed", "nan"],
        ["sim", "nexstar", "--latency", "inf"],
    ],
)
def test_malformed_flag_value_is_reported_in_one_printable_line(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.startswith("mount-gateway: ")
    assert said.endswith("\n")
    assert said.count("\n") == 1
    assert said[:-1].isprintable()
    assert len(said) < 600
