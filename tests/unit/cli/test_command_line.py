"""The command line as a person meets it: ready lines, one clear line for every mistake, clean ends."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import socket
import sys
import threading
import time
from pathlib import Path

import pytest

from gateway.cli import main
from gateway.cli.serve import finding
from gateway.diagnostics.detect import scan_port
from gateway.diagnostics.detect.scan_port import ProbeTimes
from tests.support.process import PATIENCE, Running, ask


def refused(*arguments: str) -> str:
    """The one line that a mistake gets, and nothing else; in this process, for a Python takes long to start."""
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        assert main(list(arguments)) == 2
    [line] = error.getvalue().splitlines()
    assert out.getvalue() == "" and line.startswith("mount-gateway: ")
    return line


def test_command_line_mistake_ends_the_process_with_code_2() -> None:
    done = Running("run").finish()
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("mount-gateway: ") and done.stderr.count("\n") == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_demo_serves_tcp_and_a_virtual_serial_port(tmp_path: Path, started: list[Running], number: int) -> None:
    pty = tmp_path / "lx200"
    demo = Running("demo", "--port", "0", "--pty", str(pty))
    started.append(demo)
    anybody, tcp, serial_name = demo.ready(), demo.ready(), demo.ready()
    assert serial_name == f"pty:{pty}"
    assert re.fullmatch(rb"\d\d:\d\d:\d\d#", ask(tcp, b":GR#"))
    assert re.fullmatch(rb"[0-9A-F]{4},[0-9A-F]{4}#", ask(anybody, b"E"))
    device = os.open(pty, os.O_RDWR | os.O_NOCTTY)
    os.write(device, b"#:GD#")
    heard = b""
    while not heard.endswith(b"#"):
        heard += os.read(device, 100)
    os.close(device)
    assert re.fullmatch(rb"[+-]\d\d\xdf\d\d:\d\d#", heard)
    assert demo.end(number) == 0
    assert not pty.is_symlink()


def test_run_applies_a_config_files_settings(tmp_path: Path, started: list[Running]) -> None:
    path = tmp_path / "gateway.toml"
    path.write_text(
        '[mount]\nat = "nexstar:cge@sim"\nsite = [-34.0, 18.5]\n'
        '[[surface]]\nat = "lx200:lx200gps@tcp://127.0.0.1:0"\nprecision = "low"\n'
    )
    gateway = Running("run", str(path))
    started.append(gateway)
    where = gateway.ready()
    assert ask(where, b":GVP#") == b"LX2001#"
    assert re.fullmatch(rb"\d\d:\d\d\.\d#", ask(where, b":GR#"))
    assert ask(where, b":Gt#") == b"-34*00#"


class Stranger:
    """Something on a line that is no hand control. ``answers`` says what it answers to which byte."""

    def __init__(self, answers: dict[bytes, bytes]) -> None:
        self.answers, self.heard = answers, b""
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE)
        self.mount = f"nexstar@socket://127.0.0.1:{self.socket.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                link, _ = self.socket.accept()
                link.settimeout(PATIENCE)
                while piece := link.recv(100):
                    self.heard += piece
                    for asked, answer in self.answers.items():
                        if asked in piece:
                            link.sendall(answer)
                link.close()

    def taken_for_a_hand_control(self) -> str:
        """The one line that a gateway ends with."""
        with self.socket:
            return refused("run", "--no-wait", "--mount", self.mount, "--surface", "lx200@tcp://127.0.0.1:0")


@pytest.fixture
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stranger is given a tenth of the time; how long it should be is the business of the tests of ``detect``."""
    monkeypatch.setattr(finding, "REPLY_WAIT", 0.3)
    monkeypatch.setattr(
        scan_port,
        "AT_9600",
        ProbeTimes(required_silence=0.1, silence_timeout=0.3, query_interval=0.1, answer_timeout=0.4),
    )


@pytest.mark.usefixtures("_hasty")
def test_meade_behind_a_nexstar_endpoint_is_recognised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        scan_port,
        "AT_9600",
        ProbeTimes(required_silence=0.1, silence_timeout=0.3, query_interval=0.1, answer_timeout=PATIENCE),
    )
    meade = Stranger({b"\x06": b"P"})
    assert "speaks lx200" in meade.taken_for_a_hand_control()
    assert b":" not in meade.heard


def test_run_finds_a_mount_that_is_switched_on_later(started: list[Running]) -> None:
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
    gateway = Running("run", "--wait", "--mount", f"nexstar@socket://127.0.0.1:{port}", "--surface", "lx200@tcp://:0")
    started.append(gateway)
    where = gateway.ready()
    simulator = Running("sim", "nexstar:cpc", "--at", f"tcp://127.0.0.1:{port}")
    started.append(simulator)
    simulator.ready()
    deadline = time.monotonic() + PATIENCE
    host, _, number = where.removeprefix("tcp://").rpartition(":")
    with socket.create_connection((host, int(number)), PATIENCE) as link:
        link.settimeout(1.0)
        heard = b""
        while not heard and time.monotonic() < deadline:
            link.sendall(b":GR#")
            try:
                heard = link.recv(100)
            except TimeoutError:
                continue
    assert re.match(rb"\d\d:\d\d:\d\d#", heard)


@pytest.mark.parametrize("encoding", ["cp437", "ascii"])
@pytest.mark.parametrize(
    "words", [["explain", "lx200", "cpc", ":Sd+12*00:00#"], ["run", "--surface", "lx200@tcp://0.0.0.0:4030 …"]]
)
def test_terminal_with_a_small_character_set_gets_plain_characters(
    words: list[str], encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding, errors="strict") for _ in range(2))
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    assert main(words) == (2 if words[0] == "run" else 0)
    written = [stream.buffer.getvalue() if stream.flush() is None else b"" for stream in (out, err)]
    told = b"".join(written).decode(encoding)
    assert told and "\\u" not in told
    if words[0] == "explain":
        assert "Dec +12%s00'00" % ("°" if encoding == "cp437" else "d") in told
