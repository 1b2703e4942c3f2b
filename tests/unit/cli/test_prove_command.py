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
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from gateway.app.config import Config, MountConfig
from gateway.app.state.mount_claim import MountTaken
from gateway.cli import main
from gateway.cli.inspect.prove import LINE_COLUMNS, CheckTerminal, config_for_check, summarize
from gateway.core.errors import UserError
from gateway.diagnostics.prove.findings import DIFFERS, SAME, Finding, Findings, ProofFile, save
from gateway.diagnostics.prove.guide import STAGES
from tests.support.process import GATEWAY

pytestmark = pytest.mark.real_time
MOUNT = "Celestron NexStar 6-8se 4.21"
RATES = Finding(
    "rates of all keys", DIFFERS, "measured", "its maker's", keys={"rates": [0.5 * n for n in range(1, 10)]}
)


def test_prove_prints_lines_that_fit_a_phone(capsys: pytest.CaptureFixture[str]) -> None:
    async def talk() -> None:
        terminal = CheckTerminal()
        terminal.say("  " + "a sentence of many words " * 9)
        for part in (0.0, 0.5, 1.0):
            terminal.show_progress(part, "a long word " * 9)
        terminal.say("the end")

    asyncio.run(talk())
    out = capsys.readouterr().out
    assert "[#######.......]" in out and "[##############]" in out
    lines = [line for whole in out.split("\n") for line in whole.split("\r")]
    assert max(map(len, lines)) <= LINE_COLUMNS
    assert lines[0].startswith("  a sentence") and lines[1].startswith("    ")


async def test_prove_accepts_single_keys_and_a_space_at_any_question() -> None:
    terminal = CheckTerminal()
    for key in "y ":  # before the question: only the space bar counts
        terminal.on_key(key)
    assert await terminal.ask_for_key("y: yes  q: leave", "yq") == " "
    terminal.stop.clear()
    for keys, answer in (("xY", "y"), ("x ", " ")):
        asking = asyncio.ensure_future(terminal.ask_for_key("y: yes  q: leave", "yq"))
        await asyncio.sleep(0)
        for key in keys:
            assert not asking.done()
            terminal.on_key(key)
        assert await asking == answer
    assert terminal.stop.is_set()


async def test_q_during_a_prove_stage_stops_the_mount_and_then_quits() -> None:
    terminal = CheckTerminal()
    for key in "qy":
        terminal.on_key(key)
    assert await terminal.ask_for_key("y: yes  q: leave", "yq") == " "  # the mount is stopped first
    terminal.stop.clear()
    assert await asyncio.wait_for(terminal.ask_for_key("y: yes  q: leave", "yq"), 60.0) == "q"
    asking = asyncio.ensure_future(terminal.ask_for_key("y: yes  q: leave", "yq"))  # that one q answered one question
    await asyncio.sleep(0)
    terminal.on_key("y")
    assert await asyncio.wait_for(asking, 60.0) == "y"


def test_prove_configures_its_gateway_to_keep_far_from_the_sun() -> None:
    config = config_for_check(Config([MountConfig(at="nexstar@sim", sun=0.0, lowest=15.0, record="mine.rec")]))
    [mount] = config.mount
    assert (mount.sun, mount.lowest, mount.record) == (40.0, 15.0, "mine.rec")
    assert not config.status
    with pytest.raises(UserError, match="one mount"):
        config_for_check(Config([mount, mount]))


def test_prove_summary_lists_each_value_that_differs() -> None:
    findings = Findings(
        stages={"reads": [Finding("identity", SAME), Finding("rate 9", DIFFERS, "3°/s", "5°/s", "Slow.")]}
    )
    first, second, third = summarize(findings)
    assert "1 same, 1 differs" in first
    assert second == "differs  rate 9: 3°/s (assumed: 5°/s)"
    assert "Not done: sky, motions" in third


@pytest.mark.parametrize("where", ["sim", "/dev/ttyUSB0"])
def test_prove_starts_no_further_check_after_ctrl_c(
    where: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Ctrl-C ends the whole check, and nobody is asked anything; what was found is told and written."""
    save(tmp_path / "findings.json", Findings("mount", "m", stages={"motions": [RATES]}))
    monkeypatch.setattr("gateway.cli.serve.serving.run_on_loop", lambda *arguments: 0)
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    assert main(["prove", "--mount", f"nexstar@{where}", "--folder", str(tmp_path)]) == 0
    written = msgspec.json.decode((tmp_path / "prove-m-unknown.json").read_bytes(), type=ProofFile)
    assert written.simulated == (where == "sim")


def test_prove_without_a_terminal_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["prove", "--mount", "nexstar@sim"]) == 2
    assert "start it in a terminal" in capsys.readouterr().err


@pytest.mark.parametrize("where", ["socket://127.0.0.1:4999", "/dev/ttyUSB0"])
def test_prove_refuses_a_mount_used_by_a_gateway(
    where: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def taken(*_: object) -> int:
        raise MountTaken(f"nexstar@{where}: words for a program", "process 17")

    monkeypatch.setattr("gateway.cli.serve.serving.run_on_loop", taken)
    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True))
    assert main(["prove", "--mount", f"nexstar@{where}", "--folder", str(tmp_path)]) == 2
    assert "another mount-gateway (process 17)" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
def test_prove_ends_and_writes_its_file_in_a_terminal(tmp_path: Path) -> None:
    """It writes the file for the maintainers, and shows the lines that adapt gateway.toml."""
    import pty

    (folder := tmp_path / "prove").mkdir()
    done = {stage.name: [Finding(stage.name, SAME)] for stage in STAGES} | {"motions": [RATES]}
    save(folder / "findings.json", Findings(MOUNT, "6-8se", "4.21", stages=done))
    toml = tmp_path / "gateway.toml"
    toml.write_text('[mount]\nat = "nexstar:6-8se@sim"\n\n[[surface]]\nat = "any@tcp://127.0.0.1:0"\n')
    ours, theirs = pty.openpty()
    words = [*GATEWAY, "prove", "gateway.toml", "--no-console"]
    process = subprocess.Popen(words, stdin=theirs, stdout=theirs, stderr=theirs, cwd=tmp_path)
    os.close(theirs)
    screen, end = "", time.monotonic() + 120.0
    while process.poll() is None and time.monotonic() < end:
        if select.select([ours], [], [], 0.2)[0]:
            with contextlib.suppress(OSError):  # the terminal's other end was closed
                screen += os.read(ours, 4096).decode("utf-8", "replace")
    process.kill()
    os.close(ours)
    assert process.wait() == 0, screen
    assert all(screen.count(words) == 1 for words in ("found Celestron", "Your mount: ")), screen
    assert "rates = [0.5, 1.0, 1.5" in screen and "rates" not in toml.read_text()
    assert {path.name for path in folder.iterdir()} == {"findings.json", "prove-6-8se-4.21.json"}
    written = msgspec.json.decode((folder / "prove-6-8se-4.21.json").read_bytes(), type=ProofFile)
    assert written.simulated and written.mount == MOUNT and written.stages == done
    assert max(len(line) for line in re.split(r"[\r\n]", screen)) <= LINE_COLUMNS
    assert "Wrote prove/prove-6-8se-4.21.json" in screen
    assert "send it to whoever gave you" in " ".join(screen.split())
