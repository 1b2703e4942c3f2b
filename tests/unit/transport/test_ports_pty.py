"""The virtual serial port: openings are connections, and nothing of one program reaches the next."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import grp
import os
import select
import stat
import subprocess
import sys
import tempfile
import termios
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
import serial

from gateway.cli.serve.serving import run_on_loop
from gateway.core.errors import UserError
from gateway.transport.pty import PtyPort

PATIENCE = 60.0
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the end of a connection is told on Linux only")


class Visitor:
    """A guest that answers ``?`` with ``!``, and writes down what happens to it in the house's book."""

    all_answered = True

    def __init__(self, book: list[str], write: Callable[[bytes], Any]) -> None:
        self.book, self.write = book, write
        book.append("arrives")

    def feed(self, data: bytes) -> None:
        self.book.append(data.decode("latin-1"))
        self.write(b"!" * data.count(b"?"))

    def close(self) -> None:
        self.book.append("leaves")


def on_a_port(path: Path, program: Callable[[PtyPort, list[str]], Awaitable[None]], fast: bool = False) -> list[str]:
    """Run a program on a port -> the book of its visitors."""
    book: list[str] = []

    async def main() -> int:
        port = PtyPort(str(path), lambda connected: Visitor(book, connected.write))
        try:
            async with asyncio.timeout(PATIENCE * 2):
                await program(port, book)
        finally:
            await port.close()
        return 0

    run_on_loop(fast, main)
    return book


async def until(happened: Callable[[], bool]) -> None:
    async with asyncio.timeout(PATIENCE):
        while not happened():
            await asyncio.sleep(0.002)


def opened(path: Path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)


@LINUX
@pytest.mark.parametrize("fast", [False, True])
def test_every_opening_of_a_virtual_port_is_a_new_connection(tmp_path: Path, fast: bool) -> None:
    path = tmp_path / "lx200"

    async def program(port: PtyPort, book: list[str]) -> None:
        for _ in range(3):
            device = opened(path)
            os.write(device, b"?")
            await until(lambda: book[-1:] == ["?"])
            other = opened(path)
            os.close(device)  # one of two: somebody is there still
            os.write(other, b"last words")
            os.close(other)
            await until(lambda: book[-1:] == ["leaves"])
        device = opened(path)  # and one that says nothing is none
        os.close(device)
        await asyncio.sleep(0.01)

    assert on_a_port(path, program, fast) == ["arrives", "?", "last words", "leaves"] * 3
    assert not path.is_symlink()


@LINUX
def test_next_program_on_a_virtual_port_gets_no_old_bytes_or_settings(tmp_path: Path) -> None:
    path = tmp_path / "lx200"

    async def program(port: PtyPort, book: list[str]) -> None:
        device = opened(path)
        mode = termios.tcgetattr(device)
        mode[3] |= termios.ECHO | termios.ICANON
        termios.tcsetattr(device, termios.TCSANOW, mode)
        os.write(device, b"??")
        await until(lambda: "??" in book)
        os.close(device)  # without having read the answer
        await until(lambda: book[-1:] == ["leaves"])
        device = opened(path)
        with pytest.raises(BlockingIOError):
            os.read(device, 10)
        assert not termios.tcgetattr(device)[3] & (termios.ECHO | termios.ICANON)
        os.close(device)

    on_a_port(path, program)


#: Takes a port for itself as INDI does, asks, and closes it; another one must get it all the same.
EXCLUSIVE = """
import fcntl, os, sys, termios, time
if os.getuid() == 0:
    os.setgid(65534); os.setuid(65534)
for _ in range(2):
    end = time.monotonic() + 60
    while True:
        try:
            device = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
            break
        except OSError as error:
            if time.monotonic() > end:
                raise
            time.sleep(0.01)
    fcntl.ioctl(device, termios.TIOCEXCL)
    os.write(device, b"?")
    assert os.read(device, 1) == b"!"
    os.close(device)
"""


@LINUX
def test_exclusive_use_of_a_virtual_port_ends_with_the_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway must not get round it as root, so it is refused the opening as another user would be."""
    folder = Path(tempfile.mkdtemp(dir="/tmp"))
    folder.chmod(0o755)
    path = folder / "lx200"
    monkeypatch.setattr("gateway.transport.pty.set_serial_permissions", lambda device: os.chmod(device, 0o666))
    real = os.open

    def refused(name: Any, flags: int, *more: Any) -> int:
        if str(name).startswith("/dev/pts/") and os.getuid() == 0:
            raise OSError(16, "Device or resource busy")
        return real(name, flags, *more)

    monkeypatch.setattr("gateway.transport.pty.os.open", refused)

    async def program(port: PtyPort, book: list[str]) -> None:
        visitor = await asyncio.create_subprocess_exec(sys.executable, "-c", EXCLUSIVE, str(path))
        assert await visitor.wait() == 0
        await until(lambda: book.count("leaves") == 2)

    try:
        assert on_a_port(path, program) == ["arrives", "?", "leaves"] * 2
    finally:
        folder.rmdir()


@pytest.mark.parametrize("settings", [
    {"baudrate": 115200}, {"baudrate": 31250}, {"rtscts": True, "dsrdtr": True}, {"xonxoff": False, "exclusive": True},
    {"bytesize": 7, "parity": "E", "stopbits": 2},
])  # fmt: skip
def test_virtual_port_works_at_any_baud_rate_and_parity(tmp_path: Path, settings: dict[str, Any]) -> None:
    path = tmp_path / "lx200"

    def ask() -> bytes:
        with serial.Serial(str(path), timeout=PATIENCE, **settings) as device:
            device.reset_input_buffer()
            device.write(b"?")
            return bytes(device.read(1))

    async def program(port: PtyPort, book: list[str]) -> None:
        assert await asyncio.to_thread(ask) == b"!"

    on_a_port(path, program)


def test_modem_lines_of_a_virtual_port_are_refused_as_on_any_terminal(tmp_path: Path) -> None:
    path = tmp_path / "lx200"

    async def program(port: PtyPort, book: list[str]) -> None:
        device = opened(path)
        for request in (termios.TIOCMBIS, termios.TIOCMBIC, termios.TIOCMSET, termios.TIOCMGET):
            with pytest.raises(OSError, match=r"Inappropriate ioctl|Invalid argument"):
                fcntl.ioctl(device, request, bytes(4))
        os.write(device, b"?")
        await until(lambda: book[-1:] == ["?"])
        os.close(device)

    on_a_port(path, program)


def test_virtual_port_has_the_mode_and_group_of_a_serial_port(tmp_path: Path) -> None:
    async def program(port: PtyPort, book: list[str]) -> None:
        seen = os.stat(port.path)
        assert stat.S_IMODE(seen.st_mode) == 0o660
        if os.getuid() == 0 and "dialout" in {group.gr_name for group in grp.getgrall()}:
            assert grp.getgrgid(seen.st_gid).gr_name == "dialout"

    on_a_port(tmp_path / "lx200", program)


@pytest.mark.parametrize("what", ["no directory", "a file", "a directory", "a link to"])
def test_virtual_port_path_that_cannot_be_used_is_reported_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    locks = tmp_path / "locks"
    locks.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(locks))
    mine = tmp_path / "mine"
    path = tmp_path / "lx200"
    match what:
        case "no directory":
            path = tmp_path / "none" / "lx200"
        case "a file":
            path.write_text("mine")
        case "a directory":
            path.mkdir()
        case "a link to":
            mine.write_text("mine")
            path.symlink_to(mine)

    async def main() -> None:
        with pytest.raises(UserError, match=f"cannot make {path}: there is {what}"):
            PtyPort(str(path), lambda connected: Visitor([], connected.write))

    asyncio.run(main())
    assert path.exists() == (what != "no directory")
    assert list(locks.iterdir()) == []


def test_link_of_a_crashed_gateway_is_replaced_but_not_a_live_link(tmp_path: Path) -> None:
    path = tmp_path / "lx200"
    path.symlink_to("/dev/pts/99999")

    async def program(port: PtyPort, book: list[str]) -> None:
        with pytest.raises(UserError, match="another gateway holds it"):
            PtyPort(str(path), lambda connected: Visitor([], connected.write))
        assert path.exists()

    on_a_port(path, program)


def test_endless_writer_on_a_virtual_port_does_not_block_the_gateway(tmp_path: Path) -> None:
    path = tmp_path / "lx200"

    async def program(port: PtyPort, book: list[str]) -> None:
        flood = await asyncio.create_subprocess_exec("sh", "-c", f"exec cat /dev/zero > {path}")
        try:
            await until(lambda: len(book) > 10)
            for _ in range(20):
                async with asyncio.timeout(60):
                    await asyncio.sleep(0)
        finally:
            flood.kill()
            await flood.wait()

    book = on_a_port(path, program)
    assert book[0] == "arrives"


def test_transport_modules_import_on_windows_without_virtual_ports() -> None:
    """No module of ports and wires needs what only Unix has before it is used."""
    code = (
        "import sys\nfor name in ('fcntl', 'pty', 'tty', 'termios', 'grp', 'pwd', 'resource'):\n"
        "    sys.modules[name] = None\n"
        "import gateway.app.gateway, gateway.diagnostics.detect, gateway.app.simulated, gateway.cli\n"
        "import gateway.transport as ports\n"
        "import asyncio\n"
        "try:\n    asyncio.run(ports.open_port('pty:/tmp/x', None))\n"
        "except Exception as error:\n    print(error)\n"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert said.stderr == ""
    assert "no pseudo-terminals on this system" in said.stdout


@pytest.mark.real_time
@pytest.mark.skipif(not hasattr(select, "epoll"), reason="nothing tells that it is closed")
async def test_next_program_on_a_virtual_port_reads_no_answers_to_the_last_one(tmp_path: Path) -> None:
    """What the flood has left on either side of the terminal is gone: answers nobody read, and those still to come."""
    book: list[str] = []
    port = PtyPort(str(tmp_path / "p"), lambda connected: Visitor(book, connected.write))
    for turn in range(3):
        flood = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        for _ in range(60):
            with contextlib.suppress(BlockingIOError):
                os.write(flood, b"?" * 4096)
            await asyncio.sleep(0)
        with contextlib.suppress(BlockingIOError):
            os.write(flood, b"?" * 4096)
        os.close(flood)
        while book.count("leaves") <= 2 * turn:
            await asyncio.sleep(0.005)
        late = os.open(port.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        os.write(late, b"?")
        heard = b""
        for _ in range(20):
            with contextlib.suppress(BlockingIOError):
                heard += os.read(late, 65536)
            await asyncio.sleep(0.005)
        assert heard == b"!"
        os.close(late)
        while book.count("leaves") <= 2 * turn + 1:
            await asyncio.sleep(0.005)
    await port.close()
