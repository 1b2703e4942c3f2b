"""What a newcomer meets on the command line: help that lists what there is, mistakes before greetings, quick ends."""

from __future__ import annotations

import asyncio
import signal
import socket
import time
from pathlib import Path

import pytest

from gateway.cli import main
from gateway.cli.serve.signals import unless
from gateway.core.errors import UserError
from gateway.protocols.wireformat.command_set import load
from tests.support.process import Running


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["demo", "--speed", "0"], "--speed 0.0: write a number more than 0"),
        (["demo", "--port", "70000"], "--port: tcp://127.0.0.1:70000: a port is a number"),
        (["demo", "--port", "0", "--pty", "/does/not/exist/x"], "/does/not/exist/x"),
        (["run", "--site", "151.2,-33.9"], "the latitude comes first: -33.9,151.2?"),
        (["sim", "nexstar:cpc", "--site", "-33.9,500"], "longitude -180 to 180"),
        (["config"], "which mount?"),
        (["config", "--mount", "nexstar@sim"], "at least one surface"),
    ],
)
def test_a_mistake_comes_alone(arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert says in shown.err
    assert len(shown.err.splitlines()) == 1


def test_who_gave_a_configuration_is_told_what_to_write_into_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text("")
    assert main(["config", str(path)]) == 2
    shown = capsys.readouterr().err
    assert f"{path}: which mount?" in shown and "[mount]" in shown
    assert "--config FILE" not in shown


def test_the_help_of_sim_lists_every_model(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["sim", "--help"])
    shown = capsys.readouterr().out
    assert end.value.code == 0
    for protocol in ("lx200", "nexstar"):
        for name, row in load(protocol).models.items():
            [line] = [line for line in shown.splitlines() if line.split()[:1] == [f"{protocol}:{name}"]]
            assert line.split()[1:] == row.get("versions", []) + ["starsense-1.20"] * row.get("starsense", False)


def test_the_help_of_run_tells_of_ranges_and_defaults(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["run", "--help", "all"])
    words = " ".join(capsys.readouterr().out.split())
    for part in ("--no-wait", "--guide-rate RATE", "(default 15)", "alt-az,eq-north,eq-south", "--park AZ,ALT"):
        assert part in words


def test_a_signal_ends_the_search_for_a_mute_mount() -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        mute.settimeout(60)
        mount = f"nexstar@socket://127.0.0.1:{mute.getsockname()[1]}"
        gateway = Running("run", "--surface", "lx200@tcp://127.0.0.1:0", "--mount", mount)
        link, _ = mute.accept()
        with link:
            link.settimeout(60)
            assert link.recv(1) == b"V"
            began = time.monotonic()
            told = gateway.finish(signal.SIGINT)
    assert (told.returncode, told.stdout, told.stderr) == (0, "", "")
    assert time.monotonic() - began < 3.4  # an answer of the mount would be waited for 3.5 s


def test_whatever_is_under_way_ends_with_the_signal() -> None:
    async def story() -> tuple[bool, bool]:
        done, cleaned = asyncio.Event(), False

        async def work() -> None:
            nonlocal cleaned
            try:
                await asyncio.sleep(3600)
            finally:
                cleaned = True

        asyncio.get_running_loop().call_later(0.01, done.set)
        await asyncio.wait_for(unless(done, asyncio.ensure_future(work())), 60)
        return done.is_set(), cleaned

    assert asyncio.run(story()) == (True, True)


def test_what_the_search_finds_wrong_is_raised() -> None:
    async def story() -> None:
        async def work() -> None:
            raise UserError("no mount answers")

        await unless(asyncio.Event(), asyncio.ensure_future(work()))

    with pytest.raises(UserError, match="no mount answers"):
        asyncio.run(story())
