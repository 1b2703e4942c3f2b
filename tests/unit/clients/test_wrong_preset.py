"""A program whose preset is the wrong one is told of in one line, with what to do, also without ``--log``."""

from __future__ import annotations

import asyncio
import socket

import pytest

from gateway.app.mount_state import mount_state
from gateway.clients.wrong_preset import advice
from tests.support.in_memory_connections import Caller
from tests.support.in_process_gateway import Bridge
from tests.support.process import Running

NEXSTAR_ON_LX200 = (
    "127.0.0.1:50000 sends `{}`: this looks like a NexStar program on an LX200 surface. Choose a type "
    'like "Meade LX200 GPS" in the program, or add --surface nexstar@tcp://127.0.0.1:4031'
)
LX200_ON_NEXSTAR = (
    "127.0.0.1:50000 sends `{}`: this looks like an LX200 program on a NexStar surface. Choose a type "
    'like "Celestron NexStar" in the program, or add --surface lx200@tcp://127.0.0.1:4031'
)


def _listening(bridge: Bridge) -> list[str]:
    """What a person is told."""
    told: list[str] = []
    bridge.acceptor.protocol_watch.warn = told.append
    bridge.acceptor.protocol_watch.address = "tcp://127.0.0.1:4030"
    return told


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (b"Ka", "Ka"),
        (b"V", "V"),
        (b"e", "e"),
        (b"J", "J"),
        (b"h", "h"),
        (b"Kx#Kx", "Kx"),
        (b"T\2", "T\\x02"),
        (b"P\1\x10\xfe\0\0\0\2", "P\\x01\\x10\\xfe\\x00\\x00\\x00\\x02"),
    ],
)
@pytest.mark.parametrize("trusted", [False, True])
async def test_nexstar_program_on_an_lx200_surface_is_reported(said: bytes, shown: str, trusted: bool) -> None:
    async with Bridge() as bridge:
        told = _listening(bridge)
        caller = Caller(bridge.acceptor, trusted=trusted)
        caller.tell(said)
        await asyncio.sleep(2.9)
        assert told == []
        for _ in range(5):
            await asyncio.sleep(1.0)
            caller.tell(said)
        assert told == [NEXSTAR_ON_LX200.format(shown)]


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        (b":GR#", ":GR#"),
        (b"#:GR#", ":GR#"),
        (b"\x06", "\\x06"),
        (b":Sr05:34:32#", ":Sr05:34:32#"),
        (b":GVP#:GR#", ":GVP#"),
    ],
)
async def test_lx200_program_on_a_nexstar_surface_is_reported(said: bytes, shown: str) -> None:
    async with Bridge("lx200gps", driven="lx200", presented="nexstar", surface="cge") as bridge:
        told = _listening(bridge)
        caller = Caller(bridge.acceptor)
        caller.tell(said)
        await asyncio.sleep(3.1)
        assert told == [LX200_ON_NEXSTAR.format(shown)]


@pytest.mark.parametrize(
    "said",
    [
        b"Ka:GR#", b"#:GR#", b"", b"hello\n", b"\xff\xfe\xfd", b"GR#", b"9600,8n1\r\n", b"GET / HTTP/1.0\r\n\r\n",
        b":XX#", b"\r\n",
    ],
)  # fmt: skip
async def test_program_of_the_right_protocol_is_not_reported(said: bytes) -> None:
    async with Bridge() as bridge:
        told = _listening(bridge)
        Caller(bridge.acceptor).tell(said)
        await asyncio.sleep(10.0)
        assert told == []


async def test_program_that_begins_with_a_nexstar_echo_is_not_reported() -> None:
    """Stellarium Mobile opens every LX200 connection so."""
    async with Bridge() as bridge:
        told = _listening(bridge)
        for number in range(3):
            caller = Caller(bridge.acceptor, number=50000 + number)
            caller.tell(b"Ka")
            await asyncio.sleep(2.0)
            assert await caller.ask(b":GR#") != b""
            await asyncio.sleep(5.0)
            caller.close()
        assert told == []


async def test_wrong_protocol_is_recognised_across_two_connections() -> None:
    async with Bridge() as bridge:
        told = _listening(bridge)
        first = Caller(bridge.acceptor)
        first.tell(b"Ka")
        first.close()
        await asyncio.sleep(1.0)
        assert await Caller(bridge.acceptor, number=50001).ask(b":GR#") != b""
        await asyncio.sleep(5.0)
        assert told == []


async def test_program_that_retries_in_the_wrong_protocol_is_reported_once() -> None:
    async with Bridge() as bridge:
        told = _listening(bridge)
        for number in range(60):
            caller = Caller(bridge.acceptor, number=50000 + number)
            caller.tell(b"V")
            await asyncio.sleep(1.0)
            caller.close()
            await asyncio.sleep(1.0)
        assert told == [NEXSTAR_ON_LX200.format("V")]


async def test_status_shows_a_wrong_protocol_for_a_minute_once_per_host() -> None:
    async with Bridge() as bridge:
        _listening(bridge)
        for _ in range(3):
            Caller(bridge.acceptor).tell(b"Ka")
            await asyncio.sleep(4.0)
        lately = mount_state(bridge.controller).to_state().lately
        assert lately == ("1 s ago, " + NEXSTAR_ON_LX200.format("Ka").replace(":50000 sends", ": sends"),)


def test_wrong_protocol_report_suggests_an_address_for_another_surface() -> None:
    assert advice("lx200", b"e", "tcp://0.0.0.0:4030").endswith("--surface nexstar@tcp://0.0.0.0:4031")
    assert advice("nexstar", b":GR#", "pty:/tmp/nexstar").endswith("--surface lx200@pty:/tmp/nexstar-2")


def test_wrong_protocol_is_reported_on_a_terminal_without_a_log() -> None:
    gateway = Running("run", "--mount", "nexstar:6-8se@sim", "--surface", "lx200@tcp://127.0.0.1:0", "--sun", "0")
    try:
        port = int(gateway.ready().rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)) as link:
            link.sendall(b"Ka")
            assert gateway.process.stderr is not None
            told = "sends `Ka`: this looks like a NexStar program on an LX200 surface"
            line = next(line for line in gateway.process.stderr if told in line)
            assert line.rstrip().endswith(f"--surface nexstar@tcp://127.0.0.1:{port + 1}")
    finally:
        gateway.end()
    assert told not in gateway.said, "it is said once"
