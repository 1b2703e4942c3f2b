"""Five kinds of programs on one port of a real process, on both event loops; and the same recorded."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.process import PATIENCE, Running, run_to_end

GET = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
LAST = GET[:-2] + b"Connection: close\r\n\r\n"
#: Longer than what is read of a connection at a time.
LONG = LAST[:-2] + b"X-Long: " + b"x" * 2000 + b"\r\n\r\n"
GOTO = struct.pack("<HHQIi", 20, 0, 0, round(83.633 / 360 * 2**32), round(22.0145 / 360 * 2**32))


OPEN: list[Program] = []
"""Connections that are to be closed at the end of the test."""


class Program:
    """One connection."""

    def __init__(self, where: str) -> None:
        host, _, port = where.removeprefix("tcp://").rpartition(":")
        self.link = socket.create_connection((host, int(port)), PATIENCE)
        self.link.settimeout(PATIENCE)
        OPEN.append(self)

    def ask(self, data: bytes, length: int) -> bytes:
        self.link.sendall(data)
        return self.hear(length)

    def hear(self, length: int) -> bytes:
        """So many bytes."""
        heard = b""
        while len(heard) < length and (piece := self.link.recv(length - len(heard))):
            heard += piece
        return heard

    def silent(self, seconds: float) -> bool:
        """Whether nothing comes for so long."""
        self.link.settimeout(seconds)
        try:
            return not self.link.recv(65536)
        except TimeoutError:
            return True
        finally:
            self.link.settimeout(PATIENCE)

    def page(self, data: bytes = GET, slowly: float = 0.0) -> bytes:
        """The head of the answer to a request."""
        if slowly:
            for byte in data:
                self.link.sendall(bytes((byte,)))
                time.sleep(slowly)
        else:
            self.link.sendall(data)
        heard = b""
        while b"\r\n\r\n" not in heard:
            piece = self.link.recv(4096)
            if not piece:
                break
            heard += piece
        return heard.partition(b"\r\n\r\n")[0]

    def rest(self) -> bytes:
        return b"".join(iter(lambda: self.link.recv(4096), b""))

    def close(self) -> None:
        self.link.close()


@pytest.fixture
def running(tmp_path: Path) -> Iterator[list[Running]]:
    started: list[Running] = []
    yield started
    while OPEN:
        OPEN.pop().close()
    for one in started:
        one.end()


def start(running: list[Running], folder: Path, *more: str, console: bool = True) -> str:
    """A gateway -> the place of its port; the console is there when this returns."""
    page = ("--console", "tcp://127.0.0.1:0") if console else ()
    at = ("--mount", "nexstar@sim", "--surface", "any@tcp://127.0.0.1:0")
    one = Running("run", *at, "--state", str(folder / "state"), *page, *more)
    running.append(one)
    where = one.ready()
    assert where.startswith("tcp://127.0.0.1:")
    if console:
        assert one.process.stdout is not None
        assert any(line.startswith("ready console http://") for line in one.process.stdout)
    return where


@pytest.mark.parametrize("loop", ["fast", "asyncio"])
def test_one_port_serves_five_kinds_of_programs_at_once(running: list[Running], tmp_path: Path, loop: str) -> None:
    where = start(running, tmp_path, "--loop", loop)
    silent, lx200, nexstar, page, slow, long = (Program(where) for _ in range(6))
    for _ in range(5):
        assert lx200.ask(b":GR#", 9).endswith(b"#")
        assert nexstar.ask(b"e", 18).endswith(b"#")
    assert page.page().startswith(b"HTTP/1.1 200 OK")
    assert slow.page(slowly=0.005).startswith(b"HTTP/1.1 200 OK")
    assert long.page(LONG).startswith(b"HTTP/1.1 200 OK")
    put = Program(where).page(b"PUT /api/v1/none HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n")
    assert put.startswith((b"HTTP/1.1 404", b"HTTP/1.1 405", b"HTTP/1.1 400"))
    assert silent.hear(24)[:4] == b"\x18\0\0\0"
    silent.link.sendall(GOTO)
    assert lx200.ask(b":GR#", 9).endswith(b"#") and nexstar.ask(b"V", 3)[-1:] == b"#"


@pytest.mark.parametrize(("more", "words"), [((), b'content="act"'), (("--read-only",), b'content="look"')])
def test_read_only_port_shows_a_read_only_console(
    running: list[Running], tmp_path: Path, more: tuple[str, ...], words: bytes
) -> None:
    page = Program(start(running, tmp_path, *more))
    page.link.sendall(LAST)
    assert words in page.rest()


def test_port_without_a_console_gives_browsers_a_short_answer(running: list[Running], tmp_path: Path) -> None:
    where = start(running, tmp_path, console=False)
    page = Program(where)
    assert page.page().startswith(b"HTTP/1.1 404 Not Found")
    head = Program(where)
    head.link.sendall(LONG)
    assert b"--no-console" in head.rest()
    assert Program(where).ask(b":GR#", 9).endswith(b"#")


def test_any_protocol_port_serves_alpaca_at_once_and_without_a_console(running: list[Running], tmp_path: Path) -> None:
    put = b"PUT /api/v1/telescope/0/%s HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/x-www-form-urlencoded"
    put += b"\r\nContent-Length: %d\r\nConnection: close\r\n\r\n%s"
    for read_only in (False, True):
        where = start(running, tmp_path, *(["--read-only"] if read_only else []), console=False)
        for member, form in ((b"connected", b"Connected=true"), (b"tracking", b"Tracking=true")):
            program = Program(where)
            program.link.sendall(put % (member, len(form), form))
            answer = program.rest()
            assert answer.startswith(b"HTTP/1.1 200 OK")
            assert (b'"ErrorNumber": 0' in answer) is (member == b"connected" or not read_only), answer
        foreign = GET.replace(b"GET /", b"GET /api/v1/telescope/0/tracking").replace(b"127.0.0.1", b"evil.example")
        assert Program(where).page(foreign).startswith(b"HTTP/1.1 403")
    # a mount that does not answer yet keeps nobody waiting for the server
    with socket.create_server(("127.0.0.1", 0)) as silent:
        deaf = f"nexstar@socket://127.0.0.1:{silent.getsockname()[1]}"
        with socket.create_server(("127.0.0.1", 0)) as free:
            place = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        for page in ((), ("--console", "tcp://127.0.0.1:0")):
            running.append(Running("run", "--mount", deaf, "--surface", f"any@{place}", "--wait",
                                   "--state", str(tmp_path / "silent"), *page))  # fmt: skip
            end = time.monotonic() + PATIENCE
            while True:
                try:
                    early = Program(place)
                    break
                except ConnectionRefusedError:
                    assert time.monotonic() < end
                    time.sleep(0.05)
            assert early.page(GET.replace(b"GET /", b"GET /management/apiversions")).startswith(b"HTTP/1.1 200 OK")
            running.pop().end()


def test_early_browser_is_served_once_the_console_is_ready(running: list[Running], tmp_path: Path) -> None:
    one = Running(
        "run", "--mount", "nexstar@sim", "--surface", "any@tcp://127.0.0.1:0", "--state", str(tmp_path / "state"),
        "--console", "tcp://127.0.0.1:0",
    )  # fmt: skip
    running.append(one)
    early = Program(one.ready())
    assert early.page().startswith(b"HTTP/1.1 200 OK")


def test_status_names_the_console_address_before_its_first_use(running: list[Running], tmp_path: Path) -> None:
    ports = ("--surface", "any@tcp://127.0.0.1:0", "--console", "tcp://127.0.0.1:0")
    running.append(one := Running("run", "--mount", "nexstar@sim", "--state", str(tmp_path), *ports))
    assert one.ready() and not one.ready()  # of the surface, of the console
    assert "console http://127.0.0.1:" in run_to_end("status", "--state", str(tmp_path)).stdout


def test_recording_shows_programs_of_all_protocols(running: list[Running], tmp_path: Path) -> None:
    path = tmp_path / "evening.rec"
    where = start(running, tmp_path, "--record", str(path))
    silent, lx200, nexstar, page, mobile, late = (Program(where) for _ in range(6))
    assert mobile.ask(b"Ka", 2) == b"a#" and mobile.ask(b":GD#", 10).endswith(b"#")
    for _ in range(5):
        assert lx200.ask(b":GR#", 9).endswith(b"#")
        assert nexstar.ask(b"e", 18).endswith(b"#")
    assert page.page(LONG).startswith(b"HTTP/1.1 200 OK")
    assert silent.hear(72)[:4] == b"\x18\0\0\0"
    silent.link.sendall(GOTO)
    assert silent.hear(72)[:4] == b"\x18\0\0\0"
    assert late.hear(24)[:4] == b"\x18\0\0\0"
    late.link.sendall(b"#")
    assert any(late.silent(1.5) for _ in range(5)), "the first byte ends the positions, but for what was under way"
    assert late.ask(b":GVP#", 9) == b"Autostar#"
    lx200.link.sendall(b":Q#")
    for one in (silent, lx200, nexstar, page, mobile, late):
        one.close()
    running.pop().end()
    said = run_to_end("decode", str(path)).stdout
    assert said.count("speaks nexstar") == 2 and said.count("speaks lx200") == 3, said
    assert "speaks stellarium" in said
    assert "e: RA" in said and "GR: RA" in said and "go to a position" in said


def alpaca(where: str, request: str, form: str = "") -> bytes:
    """The whole answer."""
    head = f"{request} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Length: {len(form)}\r\n"
    program = Program(where)
    program.link.sendall(f"{head}Content-Type: application/x-www-form-urlencoded\r\n\r\n{form}".encode())
    return program.rest()


def test_read_only_port_refuses_alpaca_orders_except_stop(running: list[Running], tmp_path: Path) -> None:
    where = start(running, tmp_path, "--read-only")
    assert b'"Value"' in alpaca(where, "GET /management/apiversions")
    put = "PUT /api/v1/telescope/0"
    assert b'"ErrorNumber": 0' in alpaca(where, f"{put}/connected", "Connected=true&ClientID=1")
    moved = alpaca(where, f"{put}/tracking", "Tracking=false&ClientID=1")
    assert b'"ErrorNumber": 0' not in moved and moved.startswith(b"HTTP/1.1 200")
    stopped = alpaca(where, f"{put}/abortslew", "ClientID=1")
    assert b'"ErrorNumber": 0' in stopped, "a stop is never refused"
