"""A closed window of a terminal on Windows: this stands in for its kernel, which ends the process as Windows does."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.support.process import Running, ask

#: SIGUSR1 closes the window, SIGUSR2 is Ctrl-Break. Windows asks the handlers on a thread of its own.
WINDOWS = """
import ctypes, os, signal, sys, threading, types
from gateway.cli import main
from gateway.cli.serve import signals

handlers = []
kernel = types.SimpleNamespace(SetConsoleCtrlHandler=lambda handler, add: handlers.append(handler))
ctypes.WinDLL = lambda name: kernel
ctypes.WINFUNCTYPE = lambda *types: lambda called: called
signals.sys = types.SimpleNamespace(platform="win32")
signal.SIGBREAK = signal.SIGUSR2

def close_window():
    if not any(handler(0) or handler(1) for handler in handlers) and handlers[-1](2):
        os._exit(99)

signal.signal(signal.SIGUSR1, lambda *_: threading.Thread(target=close_window, daemon=True).start())
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="this stands in for Windows on another system")
@pytest.mark.parametrize("name", ["SIGUSR1", "SIGUSR2"])
@pytest.mark.safety_line(2)
def test_closed_window_or_ctrl_break_stops_the_mount(name: str, tmp_path: Path) -> None:
    script = tmp_path / "windows.py"
    script.write_text(WINDOWS)
    at = ("--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--site", "48.1,11.6", "--no-console")
    running = Running(str(script), "run", *at, "--lowest", "-90", "--sun", "0")
    ask(running.ready(), b":Sr05:34:32#:Sd+80*00:00#:MS#", b"110")
    said = running.finish(getattr(signal, name))
    assert said.returncode == 0  # it ended by itself, before the handler returned
    assert "stopped the mount" in said.stdout
