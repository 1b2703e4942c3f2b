"""What README and docs/ tell a reader to type is typed here: every command and every gateway.toml of theirs.

The mount at the serial port is a simulated one, ports are free ones and folders are the test's own; else the lines are
run as they stand. What serves is ended as soon as it is ready.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from gateway.app.control import stop_command
from gateway.cli import main
from gateway.cli.command_line import COMMANDS, make_parser
from tests.support.doc_blocks import PAGES, blocks, commands, installed, spans
from tests.support.each import each
from tests.support.process import GATEWAY, Running, ask
from tests.unit.app.test_python_api import PROGRAMS

SERVING = ("run", "demo", "sim")
#: What a reader has, and what it is here.
HERE = (
    (r"^\.venv/bin/", ""),
    (r"@/dev/ttyUSB\d", "@sim"),
    (r"--mount (\S+@sim)", r"--mount \1 --sun 0"),  # by day the Sun may stand before what the pages point at
    (r"(tcp|rfc2217)://[\d.]+:\d+", r"\1://127.0.0.1:0"),
    (r"--allow 192\.168\.1\.0/24", "--allow 127.0.0.1"),
    (r"/tmp/(lx200|nexstar)", r"{folder}/\1"),
    (r"\bdemo\b", "demo --port 0 --pty {folder}/demo"),
    (r"\bdetect\b", "detect {folder}/ttyUSB0"),
    (r"--write gateway.toml", "--write found.toml"),
)
FILE = '[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@tcp://127.0.0.1:0"\n'


def here(line: str, folder: Path) -> str:
    """The line with what is here in the place of what a reader has."""
    for what, instead in HERE:
        line = re.sub(what, instead.format(folder=folder), line)
    return line


def serves(line: str) -> bool:
    return shlex.split(line)[:2][-1] in SERVING


def served(folder: Path, monkeypatch: pytest.MonkeyPatch, started: list[Running]) -> Path:
    """Every line that serves, all at once: it gets ready, answers, ends as asked -> the state of one that goes on."""
    lines = [line for line in commands() if serves(line)]
    for number, line in enumerate(lines):
        (own := folder / str(number)).mkdir()
        monkeypatch.setenv("STATE_DIRECTORY", str(own))
        started.append(Running(*shlex.split(here(line, own))[1:]))
    for line, one in zip(lines, started, strict=True):
        where = one.ready()
        if where.startswith("tcp://") and "lx200@tcp" in line:
            assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(where, b":GR#")), line
    stays = next(number for number, line in enumerate(lines) if "lx200@pty" in line)
    for number, (line, one) in enumerate(zip(lines, started, strict=True)):
        assert number == stays or one.end() == 0, f"{line}: {one.said}"
    return folder / str(stays)


def test_every_documented_command_does_what_its_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], started: list[Running]
) -> None:
    """In the order of the pages; first what serves, for one of them makes the recording that others read."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(stop_command, "SEARCH_PERIOD", 0.01)
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "gateway.toml").write_text(FILE)
    (tmp_path / "bin").mkdir()
    (shim := tmp_path / "bin" / "mount-gateway").write_text(f'#!/bin/sh\nexec {shlex.join(GATEWAY)} "$@"\n')
    shim.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    monkeypatch.setenv("STATE_DIRECTORY", str(served(tmp_path, monkeypatch, started)))
    started.append(Running("sim", "nexstar:6-8se", "--at", f"pty:{tmp_path}/ttyUSB0"))
    started[-1].ready()
    for line in commands():
        if serves(line):
            continue
        typed = here(line, tmp_path)
        if typed.startswith("mount-gateway ") and not set("<>|&") & set(typed):
            code = main(shlex.split(typed)[1:])
        else:
            code = subprocess.run(["bash", "-c", typed], timeout=60, check=False).returncode
        told = capfd.readouterr()
        assert code == 0, f"{line}: {told.err or told.out}"


def test_every_code_block_of_the_docs_is_run_or_says_why_not() -> None:
    for block in blocks():
        if block.language == "powershell":
            assert block.reason, f"{block.page.name}: {block.text}"
        elif block.language == "python":
            assert f"{block.text.strip()}\n" in PROGRAMS, f"{block.page.name}: {block.text}"
        elif block.language == "mermaid":
            assert block.page.name == "architecture.md", "a picture that no test compares with the code"
        elif block.language not in ("sh", "toml"):
            assert block.language == ""
            assert block.reason or not any(line.startswith(("$ ", "mount-gateway ")) for line in block.lines), block


def test_every_configuration_in_the_docs_is_accepted_by_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    texts = [block.text for block in blocks() if block.language == "toml"]
    assert texts
    for text in texts:
        whole = text if "mount]" in text else f'[mount]\nat = "nexstar@sim"\n{text}'
        (path := tmp_path / "gateway.toml").write_text(whole)
        assert main(["config", "--config", str(path)]) == 0, capsys.readouterr().err


def test_test_and_demo_of_the_readme_use_the_same_install_commands() -> None:
    """So that the test command, which a change has to pass, proves the first half of the demo's, too."""
    venv, pip, demo = installed()["demo"].split(" && ")
    assert [venv, pip.replace(" .", " -e '.[test]'"), ".venv/bin/python -bb -m pytest -q"] == (
        installed()["tests"].split(" && ")
    )
    assert demo == ".venv/bin/mount-gateway demo"


@each("page, span", spans())
def test_commands_within_sentences_of_the_docs_are_accepted(page: str, span: str) -> None:
    words = [word for word in shlex.split(span.partition(" … ")[0].partition(" | ")[0])[1:] if word != "…"]
    if words[0] in COMMANDS:
        make_parser(words[0]).parse_args(words)
    else:
        assert words in (["COMMAND", "--help"], ["--help"], ["--version"])


@each("page", PAGES)
def test_mounts_and_surfaces_in_tables_of_the_docs_are_accepted(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for flags in re.findall(r"`(--mount \S+ --surface [^`…]+)`", page.read_text("utf-8")):
        assert main(["config", *flags.replace("PORT", "/dev/ttyUSB0").split()]) == 0, capsys.readouterr().err
