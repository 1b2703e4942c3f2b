"""RFC 2217 as a surface: pyserial's own client, plain programs on the same port, and clients that misspeak."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
import serial
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.transport import open_port
from gateway.transport.handler import Listener, NewConnection
from gateway.transport.rfc2217 import with_telnet
from tests.support.each import each
from tests.support.sampling import as_a_rule
from tests.unit.transport.test_ports import ask, serving

EVERY_BYTE = bytes(range(256)) + b"\xff\xff\xf0\xff\xfa"
#: WILL COM-PORT-OPTION.
HELLO = b"\xff\xfb\x2c"
PYSERIAL = pytest.mark.filterwarnings("ignore::DeprecationWarning:serial.*")  # its client names its thread as of old


class Echo:
    """A guest that sends back what it hears."""

    all_answered = True

    def __init__(self, write: Callable[[bytes], Any]) -> None:
        self.heard = b""
        self.write = write
        self.closed = False

    def feed(self, data: bytes) -> None:
        self.heard += data
        self.write(data)

    def peer_closed(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True


class Telnet:
    """The server without a network: a guest, and what was sent to the client."""

    def __init__(self) -> None:
        self.sent = b""
        self.echo: Echo
        self.guest = with_telnet(self._arrive)(NewConnection("test", "127.0.0.1", self._send))

    def _arrive(self, connected: NewConnection) -> Echo:
        self.echo = Echo(connected.write)
        return self.echo

    def _send(self, data: bytes) -> None:
        self.sent += data


def session(where: str) -> tuple[bytes, list[Any]]:
    """pyserial's client in its own thread: every byte there and back, and all the settings there are."""
    with serial.serial_for_url(where, baudrate=9600, timeout=60) as port:
        port.write(EVERY_BYTE)
        heard = port.read(len(EVERY_BYTE))
        for baud in (300, 115200, 31250):
            port.baudrate = baud
        port.bytesize, port.parity, port.stopbits = 7, "E", 2
        port.dtr = port.rts = False
        port.dtr = port.rts = True
        port.rtscts = True
        port.rtscts = False
        port.xonxoff = True
        port.xonxoff = False
        port.break_condition = True
        port.break_condition = False
        port.reset_input_buffer()
        port.reset_output_buffer()
        lines = [port.cts, port.dsr, port.cd, port.ri]
        port.write(b"end")
        return heard, [*lines, port.read(3)]


@pytest.fixture
def _brisk(monkeypatch: pytest.MonkeyPatch) -> None:
    """pyserial's client looks for the answer to every setting once in 0.05 s, and rests here and there."""
    monkeypatch.setattr("serial.rfc2217.time", SimpleNamespace(sleep=lambda seconds: time.sleep(seconds / 50)))


@pytest.mark.real_time
@PYSERIAL
@pytest.mark.usefixtures("_brisk")
async def test_pyserial_over_rfc2217_sets_any_parameters_and_receives_every_byte() -> None:
    port: Listener = await open_port("rfc2217://127.0.0.1:0", lambda connected: Echo(connected.write))
    try:
        assert port.address.startswith("rfc2217://127.0.0.1:") and not port.address.endswith(":0")
        async with asyncio.timeout(60):
            heard, rest = await asyncio.to_thread(session, port.address)
    finally:
        await port.close()
    assert heard == EVERY_BYTE
    assert rest == [True, True, True, False, b"end"]


@pytest.mark.real_time
@PYSERIAL
@pytest.mark.usefixtures("_brisk")
async def test_rfc2217_port_serves_telnet_and_plain_programs_with_binary_data() -> None:
    """A binary 0xFF in both directions: the time zone of ``H`` an hour west of Greenwich, read back by ``h``."""
    clock = b"H\x0c\x00\x00\x03\x14\x1a\xff\x00"

    def hand_control(where: str) -> tuple[bytes, bytes]:
        with serial.serial_for_url(where, timeout=60) as port:
            port.write(clock)
            done = port.read(1)
            port.write(b"h")
            return done, port.read(9)

    async with serving("nexstar@rfc2217://127.0.0.1:0", mount="nexstar@sim") as gateway:
        where = gateway.ports[0].address
        assert gateway.names()[0].partition("@")[2] == where
        done, told = await asyncio.to_thread(hand_control, where)
        assert done == b"#" and told[6:] == b"\xff\x00#"
        host, _, number = where.removeprefix("rfc2217://").rpartition(":")
        plain = await asyncio.open_connection(host, int(number))
        assert await ask(plain, b"Kx") == b"x#"
        assert await ask(plain, clock) == b"#"
        plain[1].write(b"h")
        assert (await plain[0].readexactly(9))[6:] == b"\xff\x00#"
        plain[1].close()


def test_rfc2217_port_sends_no_telnet_before_its_client_does() -> None:
    telnet = Telnet()
    assert telnet.sent == b""
    telnet.guest.feed(b":GR#")
    assert telnet.sent == b":GR#"
    telnet.guest.feed(b"\xff")  # may be its beginning
    telnet.guest.feed(b"\x00#")  # is none
    assert telnet.sent == b":GR#\xff\x00#"
    telnet.guest.feed(b"a" + HELLO[:1])
    telnet.guest.feed(HELLO[1:] + b"\xff\xffb")
    assert telnet.echo.heard == b":GR#\xff\x00#a\xffb"
    assert telnet.sent.endswith(b"\xff\xffb") and b"\xff\xfb\x2c" in telnet.sent
    telnet.guest.close()
    assert telnet.echo.closed


@each("nonsense", [
    b"\xff\xf0",  # an end without a beginning
    b"\xff\xfa\xff\xf0", b"\xff\xfa\x2c\xff\xf0", b"\xff\xfa\x2c\x01\x00\xff\xf0",  # too few bytes
    b"\xff\xfa\x2c\x03\x63\xff\xf0", b"\xff\xfa\x2c\x04\x63\xff\xf0", b"\xff\xfa\x2c\x05\x63\xff\xf0",  # no such value
    b"\xff\xfa\x2c\x0a\xff\xf0", b"\xff\xfa\x2c\x0b\xff\xf0", b"\xff\xfa\x2c\x0c\xff\xf0", b"\xff\xfa\x2c\x63\xff\xf0",
    b"\xff\xfd\x63", b"\xff\xf6", b"\xff\xfa\x18\x00vt100\xff\xf0",  # other options, are you there, another terminal
])  # fmt: skip
def test_rfc2217_port_ignores_unknown_telnet_options(nonsense: bytes) -> None:
    telnet = Telnet()
    telnet.guest.feed(HELLO + nonsense + b":GR#")
    assert telnet.echo.heard == b":GR#"
    telnet.guest.feed(b"\xff\xfa\x2c\x01\x00\x00\x25\x80\xff\xf0")
    assert telnet.sent.endswith(b"\xff\xfa\x2c\x65\x00\x00\x25\x80\xff\xf0")  # 9600 baud, as ever


def test_endless_telnet_subnegotiation_is_not_stored() -> None:
    telnet = Telnet()
    telnet.guest.feed(HELLO + b"\xff\xfa" + b"x" * 1000 + b":GR#")
    assert telnet.echo.heard.endswith(b":GR#")


@settings(max_examples=as_a_rule(20, whole=50))
@given(st.lists(st.binary(max_size=12), max_size=12))
def test_rfc2217_bytes_split_anywhere_arrive_whole(pieces: list[bytes]) -> None:
    """Escaped as a client must, cut anywhere; and with anything at all nothing is raised."""
    telnet, whole = Telnet(), b"".join(pieces)
    for piece in [HELLO, *pieces]:
        for at in range(0, len(escaped := piece.replace(b"\xff", b"\xff\xff") if piece != HELLO else piece), 5):
            telnet.guest.feed(escaped[at : at + 5])
    assert telnet.echo.heard == whole
    wild = Telnet()
    for piece in pieces:
        wild.guest.feed(piece)
