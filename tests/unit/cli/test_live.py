"""A gateway on a terminal and under systemd: one line in place, and a datagram for everything systemd waits for."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from gateway.app.mount_state import mount_state
from gateway.cli.serve.live import Screen, find_terminal, start_status_updates
from gateway.system.systemd import notify, watchdog_interval
from tests.support.in_process_gateway import Bridge
from tests.support.process import GATEWAY, PATIENCE

IN_PLACE = re.compile(rb"\r(6-8se  \d\d:\d\d:\d\d [+-]\d\d\xc2\xb0\d\d'\d\d\"  tracking  no programs  \d+\.\d/s)")


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """A fake one, that listens."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "600000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        yield listener


def heard(listener: socket.socket) -> list[str]:
    """What has come so far, a datagram each."""
    datagrams = []
    with contextlib.suppress(BlockingIOError):
        while True:
            datagrams.append(listener.recv(4096).decode())
    return datagrams


def test_run_on_a_terminal_notifies_systemd_and_shows_its_status_line(systemd: socket.socket) -> None:
    master, slave = os.openpty()
    arguments = ["run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--no-console"]
    environment = {**os.environ, "TERM": "xterm", "PYTHONUTF8": "1", "NO_COLOR": "1"}
    process = subprocess.Popen([*GATEWAY, *arguments], stdout=subprocess.PIPE, stderr=slave, env=environment)
    os.close(slave)
    shown, told = b"", []
    deadline = time.monotonic() + PATIENCE
    try:
        assert process.stdout is not None
        assert any(line.startswith(b"ready ") for line in process.stdout)
        while time.monotonic() < deadline and not (IN_PLACE.search(shown) and len(told) >= 4):
            if select.select([master, systemd], [], [], 1.0)[0]:
                told += heard(systemd)
                shown += os.read(master, 4096) if select.select([master], [], [], 0)[0] else b""
        process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + PATIENCE
        while process.poll() is None:  # what nobody fetches is dropped when the socket is full
            assert time.monotonic() < deadline
            select.select([systemd], [], [], 0.1)
            told += heard(systemd)
        assert process.returncode == 0
        told += heard(systemd)
        while select.select([master], [], [], 0)[0]:
            try:
                shown += os.read(master, 4096)
            except OSError:
                break
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()
        os.close(master)
    line = IN_PLACE.findall(shown)[-1].decode()
    assert b"\n" not in shown and b"\x1b" not in shown
    assert shown.endswith(b"\r" + b" " * len(line) + b"\r")  # nothing is left of it for the prompt to stand in
    assert told.count("READY=1") == 1
    assert told[-1] == "STOPPING=1"
    assert sum(text.startswith("WATCHDOG=1") for text in told) >= 2
    assert any(re.search(r"STATUS=6-8se  \d\d:\d\d:\d\d .*no programs", text) for text in told)


async def test_systemd_watchdog_is_fed_only_while_the_mount_line_task_runs(
    systemd: socket.socket, capsys: pytest.CaptureFixture[str]
) -> None:
    async with Bridge() as bridge:
        controller = bridge.controller
        gateway = SimpleNamespace(controller=controller, state=lambda: mount_state(controller, "pier"))
        tasks = start_status_updates([gateway], Screen(None))  # type: ignore[list-item]
        assert len(tasks) == 1  # no terminal, no line
        await asyncio.sleep(2)
        beats = sum(text.startswith("WATCHDOG=1") for text in heard(systemd))
        assert beats in (10, 11)  # three in each 0.6 s
        assert bridge.controller.line._task is not None
        bridge.controller.line._task.cancel()
        await asyncio.sleep(0.5)
        heard(systemd)
        await asyncio.sleep(2)
        assert not any("WATCHDOG" in text for text in heard(systemd))
        tasks[0].cancel()
    assert capsys.readouterr().err.count("the mount I/O task has ended") == 1


def test_systemd_that_does_not_listen_delays_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "nobody"))
    notify("READY=1")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as full:
        full.bind(f"\0{tmp_path}")
        monkeypatch.setenv("NOTIFY_SOCKET", f"@{tmp_path}")
        began = time.monotonic()
        for _ in range(2000):  # more than any queue holds
            notify("WATCHDOG=1")
            assert time.monotonic() < began + 5.0
        assert full.recv(100) == b"WATCHDOG=1"


@pytest.mark.parametrize(
    ("micros", "pid", "seconds"),
    [("20000000", "", 20.0), ("20000000", "mine", 20.0), ("20000000", "1", None), ("0", "", None), ("", "", None)],
)
def test_systemd_watchdog_setting_for_another_process_is_ignored(
    monkeypatch: pytest.MonkeyPatch, micros: str, pid: str, seconds: float | None
) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", "/run/nobody")
    monkeypatch.setenv("WATCHDOG_USEC", micros)
    monkeypatch.delenv("WATCHDOG_PID", raising=False)
    if pid:
        monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()) if pid == "mine" else pid)
    assert watchdog_interval() == seconds
    monkeypatch.delenv("NOTIFY_SOCKET")
    assert watchdog_interval() is None


class Terminal(io.TextIOWrapper):
    """A terminal that remembers."""

    def __init__(self, encoding: str = "utf-8") -> None:
        self.bytes = io.BytesIO()
        super().__init__(self.bytes, encoding)

    def isatty(self) -> bool:
        return True


def test_shorter_status_line_erases_the_longer_one(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = Terminal()
    screen = Screen(terminal)
    screen.clear()
    screen.show_status("slewing")
    screen.show_status("up")
    screen.warn("a word")
    screen.clear()
    assert terminal.bytes.getvalue() == b"\rslewing\rup     \r  \r"
    assert capsys.readouterr().err == "mount-gateway: a word\n"


def test_terminal_without_a_degree_sign_gets_a_substitute() -> None:
    terminal = Terminal("ascii")
    Screen(terminal).show_status("+22°")
    assert terminal.bytes.getvalue() == b"\r+22?"


def test_status_line_is_shown_only_on_a_cursor_capable_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    assert find_terminal() is None  # both are captured
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    assert find_terminal() is terminal
    monkeypatch.setenv("TERM", "dumb")
    assert find_terminal() is None


def test_warning_beside_a_json_log_is_a_json_object(capsys: pytest.CaptureFixture[str]) -> None:
    Screen(None, prints_json=True).warn("the port is gone")
    Screen(None).warn("the port is gone")
    first, second = capsys.readouterr().err.splitlines()
    assert json.loads(first)["words"] == "the port is gone" and second == "mount-gateway: the port is gone"
