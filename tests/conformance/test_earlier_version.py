"""What an earlier version has written goes on working: recordings, states of mounts, ``gateway.toml``, flags."""

from __future__ import annotations

import argparse
import asyncio
import shutil
from pathlib import Path
from typing import Any

import pytest
import tomli

from gateway.app.config import Config, make_config, read_tables
from gateway.app.recording.format import read
from gateway.app.state.file import is_held, read_marker
from gateway.cli import main
from gateway.cli.command_line import parser
from gateway.cli.serve.settings import add_settings, settings
from gateway.core.operations import Horizontal
from gateway.diagnostics.replay.replaying import replay
from gateway.diagnostics.virtual_time import run
from tests.support.each import each
from tests.support.in_process_gateway import Bridge

FILES = Path(__file__).parent / "earlier"
TOML = FILES / "gateway.toml"
#: Connections, replies and requests of each.
RECORDINGS = {"lx200-on-nexstar": (2, 29, 148), "nexstar-on-lx200": (1, 27, 124), "killed-in-motion": (1, 5, 44)}


def taken_up(tmp_path: Path, name: str, protocol: str = "nexstar") -> Path:
    """A state folder with that file, as the gateway of a test calls it."""
    shutil.copy(FILES / "state" / name, tmp_path / f"{protocol}@bridge{Path(name).suffix}")
    return tmp_path


# --- recordings -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", RECORDINGS)
def test_its_recordings_replay(name: str) -> None:
    outcome = replay(read(FILES / f"{name}.rec"))
    assert (outcome.differences, outcome.strayed, outcome.guessed) == ([], [], "")
    assert (outcome.clients, outcome.replies, outcome.requests) == RECORDINGS[name]


@pytest.mark.parametrize("name", RECORDINGS)
def test_its_recordings_are_explained(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = FILES / f"{name}.rec"
    assert main(["decode", str(path)]) == 0
    assert "?" not in {line[26:27] for line in capsys.readouterr().out.splitlines()}
    assert main(["report", str(path), "-o", str(tmp_path / "night.html")]) == 0


# --- settings -------------------------------------------------------------------------------------------------------


def given() -> Config:
    return make_config(*read_tables(TOML))


def test_its_settings_mean_what_is_written() -> None:
    config, written = given(), tomli.loads(TOML.read_text("utf-8"))
    tables: list[tuple[Any, dict[str, Any]]] = [
        (config, {key: value for key, value in written.items() if not isinstance(value, dict | list)}),
        (config.mount[0], written["mount"]),
        (config.surface[0], written["surface"][0]),
    ]
    for table, keys in tables:
        for key, value in keys.items():
            held = getattr(table, key.replace("-", "_"))
            assert (list(held) if isinstance(held, tuple) else held) == value, key


def test_its_settings_are_accepted_by_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["config", "--config", str(TOML)]) == 0
    assert f"hour-angle-limit = 1.5  # {TOML}" in capsys.readouterr().out


def test_its_settings_as_flags_are_the_same() -> None:
    """A name is no flag: with flags there is one mount."""
    words: list[str] = []
    written = tomli.loads(TOML.read_text("utf-8"))
    surface = {
        key: value for key, value in written["surface"][0].items() if key not in ("at", "mount", "baud", "equinox")
    }
    flags = {key: value for key, value in written.items() if not isinstance(value, dict | list)}
    mount = {key: value for key, value in written["mount"].items() if key not in ("at", "name")}
    for key, value in {**flags, **mount, **surface}.items():
        if isinstance(value, bool) and key not in ("log", "read-only"):
            words.append(f"--{key}" if value else f"--no-{key}")
        elif value is not False:
            words += [f"--{key}", ",".join(map(str, value)) if isinstance(value, list) else str(value)]
    line = argparse.ArgumentParser()
    add_settings(line)
    ends = ["--mount", written["mount"]["at"], "--surface", written["surface"][0]["at"]]
    found, wanted = settings(line.parse_args([*ends, *words]))[0], given()
    for key in {**flags, **mount}:
        name = key.replace("-", "_")
        assert getattr(found if key in flags else found.mount[0], name) == getattr(
            wanted if key in flags else wanted.mount[0], name
        ), key
    for key in surface:
        assert getattr(found.surface[0], key.replace("-", "_")) == getattr(wanted.surface[0], key.replace("-", "_")), (
            key
        )


#: What went since then, as CHANGELOG says.
GONE: set[tuple[str, str]] = set()


@each("line", (FILES / "flags.txt").read_text("utf-8").splitlines())
def test_its_flags_are_known(line: str) -> None:
    command, *flags = line.split()
    [commands] = [one for one in parser([command])._actions if isinstance(one, argparse._SubParsersAction)]
    known = commands.choices[command]._option_string_actions
    assert [flag for flag in flags if flag not in known and (command, flag) not in GONE] == []


# --- states of mounts -----------------------------------------------------------------------------------------------


def test_a_mount_that_it_parked_is_parked(tmp_path: Path) -> None:
    async def program() -> None:
        bridge = Bridge("cge", "4.21", state=taken_up(tmp_path, "parked.json"))
        bridge.sim.track(0)
        async with bridge:
            assert bridge.warned == []
            assert bridge.driver.parked
            assert bridge.driver.home == Horizontal(90.00755310058594, 90.0)
            assert bridge.shared.settings.pec is True

    run(program())


def test_a_site_that_a_program_set_stands(tmp_path: Path) -> None:
    async def program() -> None:
        async with Bridge("cpc", "4.21", state=taken_up(tmp_path, "site.json")) as bridge:
            assert bridge.warned == []
            site = bridge.shared.settings.stored(0)
            assert (site.latitude, site.longitude) == pytest.approx((48.1, 11.6))

    run(program())


def test_what_was_synced_counts_on_and_the_zone_is_kept(tmp_path: Path) -> None:
    async def program() -> None:
        async with Bridge(
            "lx200gps",
            driven="lx200",
            presented="nexstar",
            surface="cpc",
            state=taken_up(tmp_path, "synced.json", "lx200"),
        ) as bridge:
            assert bridge.warned == []
            assert bridge.controller.synced.value.north == pytest.approx(0.5975, abs=0.001)
            assert bridge.shared.settings.zone == (1.0, 0)

    run(program())


def test_what_it_left_moving_is_stopped_first(tmp_path: Path) -> None:
    mark = read_marker(FILES / "state" / "killed.moving")
    assert mark is not None and (mark.mount, mark.baud) == ("nexstar@/dev/ttyUSB0", 9600)

    async def program() -> None:
        async with Bridge("cpc", "4.21", state=taken_up(tmp_path, "killed.moving")) as bridge:
            assert set(bridge.sent()[1:4]) == {b"P\2\x10$\0\0\0\0", b"P\2\x11$\0\0\0\0", b"M"}
            await asyncio.sleep(10.0)
            assert not list(tmp_path.glob("*.moving"))

    run(program())


def test_its_hold_holds() -> None:
    assert is_held(FILES / "state")
