"""``prove`` in a terminal: narrow lines, single keys, and a gateway that is set up for it."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest

from gateway.app.config import Config, MountConfig
from gateway.app.state.mount_claim import MountTaken
from gateway.cli import main
from gateway.cli.inspect.prove import _afterwards, checked, summary
from gateway.cli.inspect.prove_terminal import COLUMNS, Terminal
from gateway.core.errors import UserError
from gateway.diagnostics.prove import bundle, small_motions
from gateway.diagnostics.prove.findings import DIFFERS, SAME, Finding, Findings, save
from gateway.diagnostics.prove.guide import STAGES
from tests.support.process import GATEWAY
from tests.support.proven import Onlooker, Proven, run_calm
from tests.unit.diagnostics.prove.test_small_motions import other_rates

SITE = (47.3, 11.6)


def test_lines_fit_a_phone(capsys: pytest.CaptureFixture[str]) -> None:
    async def talk() -> None:
        terminal = Terminal()
        terminal.say("  " + "a sentence of many words " * 9)
        for part in (0.0, 0.5, 1.0):
            terminal.progress(part, "a long word " * 9)
        terminal.say("the end")

    asyncio.run(talk())
    out = capsys.readouterr().out
    assert "[#######.......]" in out and "[##############]" in out
    lines = [line for whole in out.split("\n") for line in whole.split("\r")]
    assert max(map(len, lines)) <= COLUMNS
    assert lines[0].startswith("  a sentence") and lines[1].startswith("    ")


def test_a_key_is_an_answer_and_so_is_the_space_bar_before_a_question_or_in_it() -> None:
    async def talk() -> None:
        terminal = Terminal()
        for key in "y ":  # before the question: only the space bar counts
            terminal._pressed(key)
        assert await terminal.key("y: yes  q: leave", "yq") == " "
        terminal.stop.clear()
        for keys, answer in (("xY", "y"), ("x ", " ")):
            asking = asyncio.ensure_future(terminal.key("y: yes  q: leave", "yq"))
            await asyncio.sleep(0)
            for key in keys:
                assert not asking.done()
                terminal._pressed(key)
            assert await asking == answer
        assert terminal.stop.is_set()

    asyncio.run(talk())


def test_q_in_a_stage_stops_and_answers_the_next_question() -> None:
    async def talk() -> None:
        terminal = Terminal()
        for key in "qy":
            terminal._pressed(key)
        assert await terminal.key("y: yes  q: leave", "yq") == " "  # the mount is stopped first
        terminal.stop.clear()
        assert await asyncio.wait_for(terminal.key("y: yes  q: leave", "yq"), 60.0) == "q"
        asking = asyncio.ensure_future(terminal.agrees("y: save it  n: do not"))  # that one q answered one question
        await asyncio.sleep(0)
        terminal._pressed("y")
        assert await asyncio.wait_for(asking, 60.0)

    asyncio.run(talk())


def test_between_two_gateways_only_new_warnings_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = Terminal()
    terminal.warn("its clock is wrong")
    terminal.between = True
    for line in ("its clock is wrong", "the mount does not answer"):
        terminal.say("ready lx200")
        terminal.warn(line)
    terminal.between = False
    terminal.say("the end")
    assert capsys.readouterr().out.splitlines() == ["its clock is wrong", "the mount does not answer", "the end"]


def test_without_a_recording_no_file_is_offered(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    class Silent(Terminal):
        @contextlib.contextmanager
        def open(self) -> Iterator[Terminal]:
            yield self

        async def agrees(self, question: str) -> bool:
            raise AssertionError(question)

    findings = Findings(stages={"reads": [Finding("identity", SAME)]})
    asyncio.run(_afterwards(findings, None, tmp_path, Silent()))
    assert "No file yet: it needs one of the stages place to program." in capsys.readouterr().out


def test_where_nothing_moves_the_space_bar_is_no_answer() -> None:
    async def talk() -> None:
        terminal = Terminal()
        asking = asyncio.ensure_future(terminal.agrees("y: save it  n: do not"))
        for key in " y":
            await asyncio.sleep(0)
            terminal._pressed(key)
        assert await asking and not terminal.stop.is_set()

    asyncio.run(talk())


def test_q_leaves_the_last_questions_too() -> None:
    async def talk() -> None:
        terminal = Terminal()
        asking = asyncio.ensure_future(terminal.agrees("y: write them  n: do not"))
        await asyncio.sleep(0)
        terminal._pressed("q")
        assert not await asking
        assert not await asyncio.wait_for(terminal.agrees("y: make a file  n: end"), 60.0)

    asyncio.run(talk())


def test_the_gateway_of_the_check_keeps_far_from_the_sun_and_records(tmp_path: Path) -> None:
    config = checked(Config([MountConfig(at="nexstar@sim", sun=0.0, lowest=15.0)]), tmp_path, True)
    [mount] = config.mount
    assert (mount.sun, mount.lowest, mount.record) == (40.0, 15.0, str(tmp_path / "1.rec"))
    assert {surface.at for surface in config.surface} == {"lx200@web", "nexstar@web"}
    assert not config.status
    (tmp_path / "1.rec").touch()
    assert checked(config, tmp_path, True).mount[0].record == str(tmp_path / "2.rec")
    with pytest.raises(UserError, match="one mount"):
        checked(Config([mount, mount]), tmp_path, True)


def test_the_summary_names_what_differs() -> None:
    findings = Findings(
        stages={"reads": [Finding("identity", SAME), Finding("rate 9", DIFFERS, "3°/s", "5°/s", "Slow.")]}
    )
    first, second, third = summary(findings)
    assert "1 same, 1 differs" in first
    assert second == "differs  rate 9: 3°/s (assumed: 5°/s)"
    assert "Not done: sky, motions" in third


def test_after_a_signal_nothing_else_begins(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Ctrl-C in the first stages ends the whole check, and nobody is asked anything."""
    begun = list[object]()
    monkeypatch.setattr("gateway.cli.serve.serving.with_loop", lambda *arguments: len(begun.append(arguments) or ""))
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    assert main(["prove", "--mount", "nexstar@sim", "--folder", str(tmp_path)]) == 0
    assert len(begun) == 1


def test_without_a_terminal_it_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", "--mount", "nexstar@sim"]) == 2
    assert "start it in a terminal" in capsys.readouterr().err


@pytest.mark.parametrize("where", ["socket://127.0.0.1:4999", "/dev/ttyUSB0"])
def test_a_mount_that_a_gateway_has_is_not_checked(
    where: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def taken(*_: object) -> int:
        raise MountTaken(f"nexstar@{where}: words for a program", "process 17")

    monkeypatch.setattr("gateway.cli.serve.serving.with_loop", taken)
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    assert main(["prove", "--mount", f"nexstar@{where}", "--folder", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        "mount-gateway: another mount-gateway (process 17) has this mount: end it first (Ctrl-C in its terminal), then "
        "type this command again\n"
    )


def _other_rates(folder: Path) -> None:
    """Leave a check of a mount with other rates in a folder: what was found, and its recording."""

    async def check() -> Findings:
        async with Proven(record=folder / "1.rec", every=9.0, change=other_rates, site=SITE) as proven:
            with patch.object(small_motions, "KEYS", (9, 6)):
                return await proven.check(Onlooker("ssyssss"))

    folder.mkdir()
    findings: Findings = run_calm(check())
    done = {stage.name: findings.stages.get(stage.name, [Finding(stage.name, SAME)]) for stage in STAGES}
    findings.stages = done
    save(folder / "findings.json", findings)


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_in_a_terminal_it_goes_to_its_end(tmp_path: Path) -> None:
    """It shows what changes in gateway.toml and writes it, shows the file that it makes, and saves it."""
    import pty

    _other_rates(tmp_path / "prove")
    toml = tmp_path / "gateway.toml"
    toml.write_text('[mount]\nat = "nexstar:6-8se@sim"\n\n[[surface]]\nat = "any@tcp://127.0.0.1:0"\n')
    ours, theirs = pty.openpty()
    words = [*GATEWAY, "prove", "gateway.toml", "--no-console"]
    process = subprocess.Popen(words, stdin=theirs, stdout=theirs, stderr=theirs, cwd=tmp_path)
    os.close(theirs)
    screen, answered, end = "", 0, time.monotonic() + 120.0
    while process.poll() is None and time.monotonic() < end:
        if select.select([ours], [], [], 0.2)[0]:
            with contextlib.suppress(OSError):  # the terminal's other end was closed
                screen += os.read(ours, 4096).decode("utf-8", "replace")
        if screen.count(" > ") > answered and screen.endswith(" > "):
            answered += 1
            os.write(ours, b"y")
    process.kill()
    os.close(ours)
    assert process.wait() == 0, screen
    assert all(screen.count(words) == 1 for words in ("found Celestron", "Your mount: ", "From here on")), screen
    assert "+ rates = [" in screen and "rates = [" in toml.read_text()
    assert {path.name for path in (tmp_path / "prove").iterdir()} == {"findings.json", "1.rec", "to-send"}
    saved = bundle.load(tmp_path / "prove-6-8se-4.21.zip", tmp_path)
    assert list(saved.played) == ["1.rec"] and saved.played["1.rec"].requests > 100
    assert (tmp_path / "prove" / "to-send" / "1.rec").read_bytes() == (tmp_path / "1.rec").read_bytes()
    assert max(len(line) for line in re.split(r"[\r\n]", screen)) <= COLUMNS
    assert "To read it: mount-gateway decode prove/to-send/1.rec" in screen
    assert "send it to whoever gave you mount-gateway" in " ".join(screen.split())
