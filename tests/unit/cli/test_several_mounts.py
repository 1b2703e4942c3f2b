"""Several mounts in one process: each for itself, whatever becomes of the others."""

from __future__ import annotations

import re
import signal
import socket
from pathlib import Path

import pytest

from gateway.cli import main
from tests.support.process import PATIENCE, Running, ask

WAITING = "west: nexstar@/dev/does-not-exist: cannot open /dev/does-not-exist: no such port; the gateway keeps trying"


def table(name: str, at: str, surface: str) -> str:
    return (
        f'[[mount]]\nname = "{name}"\nat = "{at}"\n[[surface]]\nmount = "{name}"\nat = "{surface}@tcp://127.0.0.1:0"\n'
    )


def ready(one: Running) -> tuple[str, str]:
    """Where the next surface is, and whose it is."""
    where, _, name = one.ready().partition(" ")
    return name, where


def test_absent_or_failing_mount_does_not_disturb_other_mounts(tmp_path: Path, started: list[Running]) -> None:
    simulator = Running("sim", "lx200:autostar", "--at", "tcp://127.0.0.1:0")
    started.append(simulator)
    address = simulator.ready().removeprefix("tcp://")
    path = tmp_path / "gateway.toml"
    path.write_text(
        "log = true\n"
        + table("east", "nexstar:cge@sim", "lx200")
        + table("west", "nexstar@/dev/does-not-exist", "lx200")
        + table("north", f"lx200@socket://{address}", "nexstar")
    )
    both = Running("run", "--config", str(path))
    started.append(both)
    places = dict(ready(both) for _ in range(3))
    assert set(places) == {"east", "west", "north"}
    lines = both.process.stderr
    assert lines is not None
    log = []
    for line in lines:  # the other two work while this one is searched for
        log.append(line)
        if WAITING in line:
            break
    assert {line.split()[1] for line in log if re.match(r"\d\d:\d\d:\d\d\.", line)} == {"east", "west", "north"}
    assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(places["east"], b":GR#"))
    assert ask(places["north"], b"Kx") == b"x#"
    host, _, port = places["west"].removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(port)), PATIENCE) as link:
        link.settimeout(PATIENCE)
        link.sendall(b":GVP#")  # needs no mount
        assert link.recv(100) == b"Autostar#"
    simulator.end(signal.SIGKILL)
    assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(places["east"], b":GR#"))
    assert both.process.poll() is None
    assert both.end() == 0


def test_run_with_one_port_in_use_exits_before_printing_ready(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        path = tmp_path / "gateway.toml"
        path.write_text(
            (table("a", "nexstar@sim", "lx200") + table("b", "nexstar@sim", "lx200"))
            .replace("127.0.0.1:0", f"127.0.0.1:{port}", 2)
            .replace(f":{port}", ":0", 1)
        )
        assert main(["run", "--config", str(path)]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert f":{port}: the port is in use" in error
    assert len(error.splitlines()) == 1


def test_ready_lines_are_the_last_of_a_gateway_start(started: list[Running]) -> None:
    one = Running(
        "run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0"
    )
    started.append(one)
    assert one.process.stdout is not None
    words: list[str] = []
    for line in one.process.stdout:
        words.append(line.split()[0])
        if line.startswith("ready console"):
            break
    assert words[-2:] == ["ready", "ready"] and {"found", "site"} <= set(words[:-2])
