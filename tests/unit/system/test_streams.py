"""stdout and stderr that cannot be written to: whoever serves goes on, whoever was only to tell something says so."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.support.process import GATEWAY

QUIET = "--no-console"  # a web server takes as long to load as all else
FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")


def shell(redirected: str, *words: str) -> subprocess.Popen[str]:
    """A gateway with its standard streams as a shell has led them elsewhere."""
    return subprocess.Popen(
        ["sh", "-c", f'exec "$@" {redirected}', "sh", *GATEWAY, *words],
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.mark.sampled(1)
@FULL
@pytest.mark.parametrize(
    ("redirected", "told"),
    [
        (">/dev/full", "mount-gateway: stdout cannot be written to (No space left on device): "),
        (">&-", "mount-gateway: stdout cannot be written to (Bad file descriptor): "),
        (">/dev/full 2>/dev/full", ""),
        ("<&- >&- 2>&-", ""),
    ],
)
@pytest.mark.parametrize("command", ["run", "sim"])
def test_server_with_broken_output_goes_on_and_ends_normally(
    command: str, redirected: str, told: str, tmp_path: Path
) -> None:
    port = tmp_path / "port"
    words = (
        ["sim", "lx200:autostar", "--at", f"pty:{port}"]
        if command == "sim"
        else ["run", "--mount", "nexstar:6-8se@sim", "--surface", f"lx200@pty:{port}", "--state", str(tmp_path), QUIET]
    )
    running = shell(redirected, *words)
    try:
        question = None
        until = time.monotonic() + 60.0
        answer = b""
        while not answer.endswith(b"#"):
            assert time.monotonic() < until
            assert running.poll() is None
            if question is None:
                with contextlib.suppress(OSError):
                    question = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
                    os.write(question, b":GVP#")
            else:
                with contextlib.suppress(BlockingIOError):
                    answer += os.read(question, 64)
            time.sleep(0.02)
        os.close(question or 0)
        if told:  # it is said with the first line that could not be written, a moment after the port is there
            select.select([running.stderr], [], [], 60.0)
        running.send_signal(signal.SIGTERM)
        _, said = running.communicate(timeout=60)
    finally:
        running.kill()
        running.wait()
    assert running.returncode == 0
    assert said.startswith(told)
    assert "Traceback" not in said
    assert said.count("\n") == bool(told)


@pytest.mark.sampled(1)
@FULL
@pytest.mark.parametrize("redirected", [">/dev/full", ">&-"])
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", [["config", "--example"], ["explain", "lx200", "nexstar", ":Q#"]])
def test_command_with_broken_output_reports_why_it_failed(
    words: list[str], unbuffered: str, redirected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    running = shell(redirected, *words)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 2
    assert said.startswith("mount-gateway: cannot write to stdout: ")
    assert said.count("\n") == 1


def test_output_pipe_closed_by_its_reader_is_no_error() -> None:
    running = shell("", "config", "--example")
    assert running.stdout is not None
    running.stdout.close()
    assert running.stderr is not None
    assert running.stderr.read() == ""
    assert running.wait(60) == 0
    running.stderr.close()
