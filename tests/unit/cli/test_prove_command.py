"""``prove`` in a terminal: narrow lines, single keys, and a gateway that is set up for it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from types import SimpleNamespace

import pytest

from gateway.app.config import Config, MountConfig
from gateway.cli import main
from gateway.cli.inspect.prove import COLUMNS, Terminal, checked, summary
from gateway.core.errors import UserError
from gateway.diagnostics.prove.findings import DIFFERS, SAME, Finding, Findings


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
        terminal._pressed("q")  # before the question: it stops, but it does not count
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


def test_where_nothing_moves_the_space_bar_is_no_answer() -> None:
    async def talk() -> None:
        terminal = Terminal()
        asking = asyncio.ensure_future(terminal.agrees("y: save it  n: do not"))
        for key in " y":
            await asyncio.sleep(0)
            terminal._pressed(key)
        assert await asking and not terminal.stop.is_set()

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
