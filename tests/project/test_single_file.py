"""The single file is whole: it plays the demo and its console, prints the tables, and its watchdog stops the mount.

It takes minutes to make, and pyinstaller (the extra ``single-file``): played with ``--whole`` alone.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
import urllib.request
from importlib.util import find_spec
from pathlib import Path

import pytest

from gateway.astro.ephemeris import keeper
from gateway.astro.ephemeris.almanac import DAY, load_stored
from tests.support.doc_blocks import ROOT
from tests.support.process import Running, ask

#: Seconds until the file is made; on a machine that has other work to do.
MADE = 900.0
#: Seconds until the axes rest: the watchdog's patience, and that of a loaded machine.
RESTS = 15.0


@pytest.fixture(scope="module")
def one(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> str:
    if not request.config.getoption("whole"):
        pytest.skip("it takes minutes: --whole")
    if find_spec("PyInstaller") is None:
        pytest.skip("pyinstaller is not installed")
    folder = tmp_path_factory.mktemp("one")
    words = [sys.executable, str(ROOT / "docs" / "tools" / "single_file.py"), str(folder)]
    done = subprocess.run(words, timeout=MADE, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return str(folder / "mount-gateway")


def test_single_file_explains_a_command(one: str, tmp_path: Path) -> None:
    """The same as the installed one, in a folder where there is nothing of the project."""
    words = ["explain", "lx200", "cpc/4.21", ":MS#"]
    told = [
        subprocess.run([*by, *words], timeout=60, capture_output=True, check=True, cwd=folder).stdout
        for by, folder in (([one], tmp_path), ([sys.executable, "-m", "gateway"], ROOT))
    ]
    assert told[0] == told[1] and len(told[0]) > 400


def test_single_file_plays_the_demo_and_shows_the_console(one: str, tmp_path: Path, started: list[Running]) -> None:
    words = ("demo", "--port", "0", "--pty", str(tmp_path / "lx200"), "--console", "tcp://127.0.0.1:0")
    started.append(demo := Running(*words, by=[one]))
    assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(demo.ready(), b":GR#"))
    assert demo.process.stdout is not None
    console = next(line for line in demo.process.stdout if line.startswith("ready console")).split()[-1]
    with urllib.request.urlopen(console, timeout=60) as page:
        assert b"STOP" in page.read()
    assert demo.end() == 0, demo.said


def test_gateway_of_the_single_file_calculates_its_almanac(
    one: str, tmp_path: Path, started: list[Running], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On an empty cache: the gateway starts the file that it was started from, and uses what that calculates."""
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path))
    started.append(run := Running("run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", by=[one]))
    assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(run.ready(), b":GR#"))
    until, sky = time.monotonic() + keeper.TIMEOUT, "closed form"
    while sky == "closed form" and time.monotonic() < until:
        status = subprocess.run([one, "status", "--json"], timeout=60, capture_output=True, text=True)
        [mount] = json.loads(status.stdout)
        sky = mount["sky"]
    assert run.end() == 0 and sky.startswith("almanac of "), run.said
    assert load_stored().count_days_from(int(time.time() // DAY)) >= keeper.DAYS_PER_CALCULATION - 1


@pytest.mark.skipif(sys.platform != "linux", reason="the child of the file that unpacks itself is looked for in /proc")
def test_watchdog_of_the_single_file_stops_the_mount(one: str, tmp_path: Path, started: list[Running]) -> None:
    """When the gateway is killed, the folder into which the file was unpacked is deleted; the watchdog goes on."""
    truth = tmp_path / "truth.jsonl"
    started.append(sim := Running("sim", "nexstar:6-8se", "--at", "tcp://127.0.0.1:0", "--truth", str(truth), by=[one]))
    mount = f"nexstar@socket://{sim.ready().removeprefix('tcp://')}"
    try:
        started.append(run := Running("run", "--mount", mount, "--surface", "lx200@tcp://127.0.0.1:0", by=[one]))
        ask(run.ready(), b":RM#:Mn#:GD#")
        wait_for_moving(truth, True)
        [child] = Path(f"/proc/{run.process.pid}/task/{run.process.pid}/children").read_text().split()
        os.kill(int(child), signal.SIGKILL)
        wait_for_moving(truth, False)
        run.end()
        assert "stopping the mount" in run.said
    finally:
        assert sim.end() == 0  # asked, not killed: what was unpacked would go on without the file that it came from


def wait_for_moving(truth: Path, moving: bool) -> None:
    """Until the axes do, or do not, by what the simulator writes that it truly does."""
    until = time.monotonic() + RESTS
    while time.monotonic() < until:
        whole_lines = truth.read_text().split("\n")[:-1] if truth.exists() else []
        if whole_lines and json.loads(whole_lines[-1])["moving"] == moving:
            return
        time.sleep(0.05)
    pytest.fail(f"moving is not {moving} within {RESTS:g} s")
