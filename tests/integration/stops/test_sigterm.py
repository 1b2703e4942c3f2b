"""SIGTERM ends a real process soon, whoever is at its doors, and stops the mount first."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.process import PATIENCE, Running, ask

#: Seconds within which a process has to end that may stop its mount first.
SOON = 30.0
GOTO = b":Sr05:30:00#:Sd+80*00:00#:MS#"
Port = tuple[str, int]


def connect(port: Port) -> socket.socket:
    return socket.create_connection(port, PATIENCE)


def an_open_page(port: Port, ending: threading.Event) -> Iterator[socket.socket]:
    with connect(port) as link:
        link.sendall(b"GET / HTTP/1.0\r\n\r\n")
        page = b"".join(iter(lambda: link.recv(65536), b""))
    found = re.search(rb'name="token" content="([^"]+)"', page)
    assert found, page[:300]
    link = connect(port)
    link.sendall(
        b"GET /socket?token=%b HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n" % found[1]
    )
    assert link.recv(12) == b"HTTP/1.1 101"
    yield link  # and reads no more


PUT = b"PUT /api/v1/telescope/0/park HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99\r\n\r\nClient"


def half_requests(port: Port, ending: threading.Event) -> Iterator[socket.socket]:
    for sent in (b"GET / HTTP/1.1\r\nHost: x\r\nX-a:", PUT, b"G", b""):
        link = connect(port)
        link.sendall(sent)
        yield link


def floods(port: Port, ending: threading.Event) -> Iterator[socket.socket]:
    """Programs that ask without pause and read nothing."""

    def flood(link: socket.socket, words: bytes) -> None:
        with contextlib.suppress(OSError):
            while not ending.is_set():
                link.sendall(words)

    for words in (b":GR#" * 500, b":Gc#" * 500):
        link = connect(port)
        threading.Thread(target=flood, args=(link, words), daemon=True).start()
        yield link


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGTERM")
@pytest.mark.parametrize("visit", [an_open_page, half_requests, floods])
def test_sigterm_ends_the_gateway_whatever_clients_are_connected(
    tmp_path: Path, visit: Callable[[Port, threading.Event], Iterator[socket.socket]]
) -> None:
    gateway = Running(
        "run", "--mount", "nexstar@sim", "--surface", "any@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0",
        "--state", str(tmp_path), "--sun", "0", "--no-discovery",
    )  # fmt: skip
    where = gateway.ready()
    assert gateway.process.stdout is not None
    next(line for line in gateway.process.stdout if line.startswith("ready console"))
    host, _, number = where.removeprefix("tcp://").rpartition(":")
    ending = threading.Event()
    assert ask(where, GOTO, b"0") == b"110"
    links = list(visit((host, int(number)), ending))
    began = time.monotonic()
    done = gateway.finish(signal.SIGTERM)
    assert time.monotonic() - began < SOON
    assert done.returncode == 0 and "stopped the mount" in done.stdout, done
    ending.set()
    for link in links:
        link.close()


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGTERM")
def test_sigterm_ends_the_gateway_while_its_mount_is_silent(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as mount:
        gateway = Running(
            "run", "--mount", f"nexstar@socket://127.0.0.1:{mount.getsockname()[1]}", "--no-discovery",
            "--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path),
        )  # fmt: skip
        mount.settimeout(PATIENCE)
        link, _ = mount.accept()
        assert link.recv(100)
        began = time.monotonic()
        gateway.end()
        assert time.monotonic() - began < SOON
        link.close()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="only where there are pipes among files")
def test_recording_to_a_pipe_is_refused_without_hanging(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    began = time.monotonic()
    done = Running(
        "run", "--mount", "nexstar@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--state", str(tmp_path),
        "--record", str(tmp_path / "pipe"),
    ).finish()  # fmt: skip
    assert done.returncode == 2 and "a plain file is needed" in done.stderr
    assert time.monotonic() - began < SOON
