"""What a newcomer meets on the command line: help that lists what there is, mistakes before greetings, quick ends."""

from __future__ import annotations

import asyncio
import signal
import socket
import time
from pathlib import Path

import pytest

from gateway.cli import main
from gateway.cli.serve.signals import race
from gateway.protocols.wireformat.command_set import load
from tests.support.process import Running


def test_user_of_a_config_file_is_told_what_to_write_into_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text("")
    assert main(["config", str(path)]) == 2
    shown = capsys.readouterr().err
    assert f"{path}: which mount?" in shown and "[mount]" in shown
    assert "--config FILE" not in shown


def test_sim_help_lists_every_model(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["sim", "--help"])
    shown = capsys.readouterr().out
    assert end.value.code == 0
    for protocol in ("lx200", "nexstar"):
        for name, row in load(protocol).models.items():
            [line] = [line for line in shown.splitlines() if line.split()[:1] == [f"{protocol}:{name}"]]
            assert line.split()[1:] == row.get("versions", []) + ["starsense-1.20"] * row.get("starsense", False)


def test_interrupt_ends_the_search_for_a_silent_mount() -> None:
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


async def test_termination_signal_cancels_pending_work() -> None:
    done, work = asyncio.Event(), asyncio.ensure_future(asyncio.sleep(3600.0))
    asyncio.get_running_loop().call_later(0.01, done.set)
    assert await race(done, work) is None
    assert work.cancelled()
