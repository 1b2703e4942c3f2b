"""--help for somebody who has never used it, and completion scripts that shells accept."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gateway.app.config.describing import keys_of
from gateway.cli import main
from gateway.cli.command_line import COMMAND_GROUPS, COMMANDS, make_parser
from gateway.cli.completion import SHELLS, completion_script
from gateway.cli.serve.settings import FLAG_GROUPS
from gateway.protocols.wireformat.command_set import load
from tests.support.each import each


def told(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    *words: str,
    columns: str = "120",
    whole: bool = False,
) -> str:
    """The help of a command."""
    monkeypatch.setenv("COLUMNS", columns)
    with pytest.raises(SystemExit) as end:
        main([*words, "--help", *(["all"] if whole else [])])
    assert end.value.code == 0
    return capsys.readouterr().out


def test_help_fits_a_screen_and_names_the_main_commands(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = told(capsys, monkeypatch, columns="80")
    assert len(page.splitlines()) <= 36
    daily, trouble, rest = COMMAND_GROUPS.values()
    listed = re.findall(r"(?m)^  ([a-z]+)  ", page)
    assert listed == [*daily, *trouble] and rest
    assert page.index("mount-gateway demo") < page.index("mount-gateway run --mount")


def test_help_all_lists_every_command_model_and_exit_code(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = told(capsys, monkeypatch, whole=True)
    assert set(re.findall(r"(?m)^  ([a-z]+)  ", page)) >= set(COMMANDS)
    for protocol in ("lx200", "nexstar"):
        assert all(f" {model}" in page for model in load(protocol).models)
    assert [line[:3] for line in page[page.index("Exit codes:") :].splitlines()[1:] if line[2:3] != " "] == [
        "  0", "  1", "  2"]  # fmt: skip


def test_run_help_fits_a_screen_and_run_help_all_has_every_key(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    few, page = (told(capsys, monkeypatch, "run", columns="80", whole=whole) for whole in (False, True))
    assert len(few.splitlines()) <= 70
    every = [key for key in (*keys_of("mount"), *keys_of("")) if key.has_flag]
    assert all(f"\n  --{key.name}" in page for key in every)
    assert all((f"\n  --{key.name}" in few) is key.in_short_help for key in every)
    titles = ["connections", "about the mount:", *(f"{title}:" for title in FLAG_GROUPS), "Examples:"]
    places = [page.index(f"\n{title}") for title in titles]
    assert places == sorted(places)
    named = {key.name for key in every}
    assert all(set(names) <= named for names in FLAG_GROUPS.values())


@each("words", [[], *([name] for name in COMMANDS)])
def test_help_is_plain_text_without_internal_terms_and_fits_the_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    """What a surface is, stands where it is first named."""
    page = told(capsys, monkeypatch, *words, columns="80")
    assert "\x1b" not in page and [line for line in page.splitlines() if len(line) > 80] == []
    for name in words:
        assert f"usage: mount-gateway {name}" in page
        assert f"Example:\n  mount-gateway {name}" in page or "Examples:\n  mount-gateway " in page
    page = " ".join(page.lower().split())
    assert not re.search(r"endpoint|synthesi|wanted, allowed|derived", page)
    assert "surface" not in page.replace("--surface", "") or re.search(r"surface[:,] (that is )?where programs", page)


def test_long_command_in_the_help_can_be_copied(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = told(capsys, monkeypatch, "run", columns="80")
    assert (
        "  mount-gateway run --mount lx200@/dev/ttyUSB0 \\\n"
        "          --surface nexstar@tcp://0.0.0.0:4030\n"
        "      NexStar programs, on other computers too, drive a Meade\n"
    ) in page


def test_config_command_takes_the_flags_of_run_without_repeating_their_help(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = " ".join(told(capsys, monkeypatch, "config").split())
    assert "--lowest DEG" not in page and "mount-gateway run --help lists them" in page
    assert main(["config", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--lowest", "15"]) == 0
    assert "--lowest DEG" in told(capsys, monkeypatch, "run")


def test_example_command_in_the_help_parses() -> None:
    page = make_parser().format_help().replace(" \\\n", " ")
    example = next(line for line in page.splitlines() if "run --mount" in line)
    arguments = make_parser().parse_args(example.split()[1:])
    assert (arguments.mount, arguments.surface) == ("nexstar@/dev/ttyUSB0", ["lx200@tcp://127.0.0.1:4030"])


@pytest.mark.parametrize("shell", SHELLS)
def test_shells_accept_their_completion_script(shell: str, tmp_path: Path) -> None:
    text = completion_script(shell)
    assert all(command in text for command in COMMANDS)
    assert "hour-angle-limit" in text
    assert "avx/starsense-1.20" in text and "gt/101.0" in text
    if shutil.which(shell):
        path = tmp_path / "script"
        path.write_text(text)
        subprocess.run([shell, "-n", str(path)], check=True, timeout=60)


@pytest.mark.skipif(not shutil.which("bash"), reason="no bash here")
def test_bash_completes_commands_and_flags(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "bash"]) == 0
    (tmp_path / "script").write_text(capsys.readouterr().out)
    (tmp_path / "night.toml").touch()
    asking = """
        source ./script
        ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _shtab_mount_gateway; echo ${COMPREPLY[*]}; }
        ask mount-gateway de
        ask mount-gateway run --mod
        ask mount-gateway run --mode ''
        ask mount-gateway run --config n
        ask mount-gateway completion f
        ask mount-gateway run --surface an
    """
    done = subprocess.run(["bash", "-c", asking], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True)
    commands, *others = done.stdout.splitlines()
    assert sorted(commands.split()) == ["decode", "demo", "detect"]
    assert others == ["--mode", "alt-az eq-north eq-south", "night.toml", "fish", "any@tcp://127.0.0.1:4040"]
