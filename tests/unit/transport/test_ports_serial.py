"""Surfaces on serial ports by name, as the half of a com0com pair is one on Windows; and any pyserial URL."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import tty

import pytest
import serial

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.core.errors import UserError
from gateway.transport import open_port, serial_port
from gateway.transport.handler import NewConnection
from gateway.transport.pty import baud_rate_of
from gateway.transport.wires import SerialTransport
from tests.support.each import each
from tests.unit.transport.test_ports import PATIENCE, serving
from tests.unit.transport.test_ports_rfc2217 import Echo

pytestmark = pytest.mark.real_time


async def read(descriptor: int, count: int) -> bytes:
    """What the other half of the pair hears."""
    heard = b""
    async with asyncio.timeout(PATIENCE):
        while len(heard) < count:
            try:
                heard += os.read(descriptor, 100)
            except BlockingIOError:
                await asyncio.sleep(0.005)
    return heard


async def test_gateway_on_one_end_of_a_serial_port_pair_answers_at_the_other() -> None:
    """The gateway opens one half, the program has the other; it may fall silent and come back."""
    program_side, gateway_side = os.openpty()
    tty.setraw(gateway_side)
    os.set_blocking(program_side, False)
    name = os.ttyname(gateway_side)

    async with serving(f"lx200@{name}") as gateway:
        assert gateway.names()[0].endswith(f"@{name}")
        for _ in range(2):
            os.write(program_side, b":GR#")
            assert len(await read(program_side, 9)) == 9
    os.close(program_side)
    os.close(gateway_side)


async def test_surface_on_a_serial_port_uses_its_configured_baud_rate() -> None:
    program_side, gateway_side = os.openpty()
    name = os.ttyname(gateway_side)
    gateway = Gateway(MountConfig(at="nexstar@sim"), [SurfaceConfig(at=f"lx200@{name}", baud=38400)])
    await gateway.open()
    assert baud_rate_of(gateway_side) == 38400
    await gateway.close()
    os.close(program_side)
    os.close(gateway_side)


async def test_lost_outgoing_socket_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A program that listens, and has the gateway come to it."""
    listening = socket.create_server(("127.0.0.1", 0))
    listening.setblocking(False)

    with listening:
        async with serving(f"lx200@socket://127.0.0.1:{listening.getsockname()[1]}"):
            loop = asyncio.get_running_loop()
            for again in (0.05, 60.0):  # and not a third time, to somebody who is gone
                async with asyncio.timeout(PATIENCE):
                    link, _ = await loop.sock_accept(listening)
                    monkeypatch.setattr(serial_port, "REOPEN_DELAY", again)
                    with link:
                        link.setblocking(False)
                        heard = b""
                        while len(heard) < 9:  # what arrives while a port is being opened is thrown away
                            await loop.sock_sendall(link, b":GR#")
                            with contextlib.suppress(TimeoutError):
                                async with asyncio.timeout(0.05):
                                    heard += await loop.sock_recv(link, 100)


async def test_loopback_port_receives_what_it_sends() -> None:
    guests: list[Echo] = []

    def arrive(connected: NewConnection) -> Echo:
        guests.append(Echo(connected.write))
        return guests[0]

    port = await open_port("loop://", arrive)
    guests[0].write(b"once")
    guests[0].write = lambda data: None
    async with asyncio.timeout(PATIENCE):
        while guests[0].heard != b"once":
            await asyncio.sleep(0.005)
    await port.close()
    assert guests[0].closed


@each("where", ["COM5", "com5", "\\\\.\\COM12", "/dev/none", "./none"])
async def test_serial_port_names_are_recognised(where: str) -> None:
    with pytest.raises(UserError, match=r"^cannot open "):
        await open_port(where, lambda connected: Echo(connected.write))


@pytest.mark.parametrize("where", ["ttyUSB0", "tcp:127.0.0.1:4030", "localhost:4030"])
async def test_text_that_is_no_port_name_is_answered_with_the_valid_forms(where: str) -> None:
    with pytest.raises(UserError, match="write tcp://HOST:PORT"):
        await open_port(where, lambda connected: Echo(connected.write))


async def test_socket_bytes_that_arrive_together_are_delivered_at_once() -> None:
    """18 bytes that arrive together wake the loop once; a byte and the end of the connection lose nothing."""
    heard, lost = list[bytes](), list[str]()
    with socket.create_server(("127.0.0.1", 0)) as server:
        wire = SerialTransport(f"socket://127.0.0.1:{server.getsockname()[1]}")
        await wire.open(heard.append, lost.append)
        link, _ = server.accept()
        async with asyncio.timeout(PATIENCE):
            link.sendall(b"34AB0000,12CE0000#")
            while sum(map(len, heard)) < 18:
                await asyncio.sleep(0.002)
            link.sendall(b"1")
            link.close()
            while not lost:
                await asyncio.sleep(0.002)
        await wire.close()
    assert heard == [b"34AB0000,12CE0000#", b"1"]


@each(
    ("told", "words"),
    [
        (
            "FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)",
            "no such port; a program opens",
        ),
        ("PermissionError(13, 'Access is denied.', None, 5)", "the port is in use by another program"),
    ],
)
async def test_windows_port_errors_are_explained_in_words(
    told: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise serial.SerialException(f"could not open port 'COM5': {told}")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(UserError, match=f"^cannot open COM5: {words}"):
        async with serving("lx200@COM5"):
            raise AssertionError("opened")
