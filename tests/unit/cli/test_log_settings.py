"""How much of the conversation is shown: by flag and by file, in words where it is written wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.app.config.describing import find_key
from gateway.cli import _escape_for_argparse, main
from gateway.cli.command_line import make_parser
from gateway.cli.serve.settings import load_config
from gateway.core.errors import UserError
from tests.support.each import each
from tests.support.process import Running, ask

RUN = ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0"]


@each(
    ("flags", "log"),
    [
        ([], False),
        (["--log"], True),
        (["--no-log"], False),
        (["--log=mount"], "mount"),
        (["--log=refusals"], "refusals"),
        (["--log", "json-changes"], "json-changes"),
        (["--log", "true"], True),
        (["--log=true"], True),
        (["--log=false"], False),
        (["--log=json"], "json"),
        (["--log=json-changes"], "json-changes"),
        (["--log", "--wait"], True),
        (["--log=program", "--no-log"], False),
    ],
)
def test_log_flags_select_what_is_logged(flags: list[str], log: Any) -> None:
    words = _escape_for_argparse([*RUN, *flags])
    assert load_config(make_parser(words[:1]).parse_args(words))[0].log == log


@pytest.mark.parametrize(
    ("written", "log"), [("true", True), ("false", False), ('"changes"', "changes"), ('"json"', "json")]
)
def test_log_settings_in_a_file_select_what_is_logged(written: str, log: Any, tmp_path: Path) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(f'log = {written}\n[mount]\nat = "nexstar@sim"\n[[surface]]\nat = "lx200@tcp://:0"\n')
    assert load_config(make_parser(["run"]).parse_args(["run", "--config", str(path)]))[0].log == log


def test_invalid_log_setting_names_the_allowed_values(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RUN, "--log=mounts"]) == 2
    said = capsys.readouterr().err
    assert "--log" in said and "program, mount, changes, refusals, json" in said


def test_gateway_logs_only_the_selected_kinds() -> None:
    gateway = Running(*RUN, "--sun", "0", "--log=changes")
    try:
        where = gateway.ready()
        assert ask(where, b":GR#") and ask(where, b":Sr05:34:32#", b"1") == b"1"
    finally:
        gateway.end()
    lines = gateway.said.splitlines()
    assert any("> :Sr05:34:32#" in line for line in lines) and not any("> :GR#" in line for line in lines)
    assert max(len(line) for line in lines) <= 80


KEYS = ["time", "mount", "side", "direction", "kind", "refused", "bytes", "hex", "words"]


@pytest.mark.parametrize("log", ["json", "json-program", "json-changes"])
def test_json_log_makes_every_line_on_stderr_an_object(log: str, tmp_path: Path) -> None:
    gateway = Running(*RUN, "--sun", "0", f"--log={log}", "--site", "50,10")
    try:
        where = gateway.ready()
        assert ask(where, b":GR#") and ask(where, b":Sr05:34:32#", b"1") == b"1"
    finally:
        gateway.end()
    told = [json.loads(line) for line in gateway.said.splitlines()]
    assert {tuple(one) for one in told} == {tuple(KEYS)}
    [set_ra] = [one for one in told if one["bytes"] == ":Sr05:34:32#"]
    assert set_ra["mount"] == "nexstar@sim" and set_ra["side"].startswith("127.0.0.1:")
    assert (set_ra["direction"], set_ra["kind"], set_ra["hex"]) == ("to mount", "command", b":Sr05:34:32#".hex())
    assert "05:34:32" in set_ra["words"] and set_ra["time"].endswith("Z")
    assert any(one["bytes"] == ":GR#" for one in told) is (log != "json-changes")
    assert any(one["side"] == "mount" and one["hex"] for one in told) is (log != "json-program")


@pytest.mark.parametrize("word", [*find_key("", "log").choices, "true", "false"])  # type: ignore[union-attr]
def test_log_flag_accepts_its_value_after_a_space(word: str) -> None:
    assert _escape_for_argparse(["run", "--log", word, "gateway.toml"]) == ["run", f"--log={word}", "gateway.toml"]
    assert _escape_for_argparse(["run", f"--log={word}", word]) == ["run", f"--log={word}", word]


def test_config_file_name_after_the_log_flag_is_no_log_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for word in ("evening.toml", "./evening"):
        assert _escape_for_argparse(["run", "--log", word]) == ["run", "--log=true", word]
    with pytest.raises(UserError, match="write one of all"):
        _escape_for_argparse(["run", "--log", "evening"])
    Path("evening").touch()
    assert _escape_for_argparse(["run", "--log", "evening"]) == ["run", "--log=true", "evening"]
    assert _escape_for_argparse(["run", "--read-only", "all"]) == ["run", "--read-only=all"]
    assert _escape_for_argparse(["run", "--read-only", "changes"]) == ["run", "--read-only=all", "changes"]
    assert _escape_for_argparse(["run", "--log", "--read-only", "true"]) == ["run", "--log=true", "--read-only=true"]
