"""Where clients come in: what one does to its connection never reaches another."""

from __future__ import annotations

import asyncio
import os
import socket
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.core.errors import UserError
from tests.support.each import each

pytestmark = pytest.mark.real_time
PATIENCE = 60.0


@asynccontextmanager
async def serving(*surfaces: str, mount: str = "nexstar@sim") -> AsyncIterator[Gateway]:
    """A gateway with a simulated mount and real ports."""
    gateway = Gateway(MountConfig(at=mount), [SurfaceConfig(at=surface) for surface in surfaces])
    await gateway.open()
    try:
        assert await gateway.wait_identified(PATIENCE)
        async with asyncio.timeout(60):
            yield gateway
    finally:
        await gateway.close()


def address(gateway: Gateway, index: int = 0) -> tuple[str, int]:
    host, _, port = gateway.ports[index].address.removeprefix("tcp://").rpartition(":")
    return host, int(port)


async def ask(link: tuple[asyncio.StreamReader, asyncio.StreamWriter], data: bytes, until: bytes = b"#") -> bytes:
    link[1].write(data)
    async with asyncio.timeout(PATIENCE):
        return await link[0].readuntil(until)


async def test_misbehaving_tcp_clients_do_not_disturb_another_one() -> None:
    async with serving("lx200@tcp://127.0.0.1:0") as gateway:
        steady = await asyncio.open_connection(*address(gateway))
        assert len(await ask(steady, b":GR#")) == 9

        for _ in range(20):  # connect and close without a byte
            with socket.create_connection(address(gateway)):
                pass
        half = socket.create_connection(address(gateway))
        half.sendall(b":Sr05:3")  # half a command, then a reset
        half.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        half.close()
        garbage = await asyncio.open_connection(*address(gateway))
        garbage[1].write(bytes(range(7, 256)) * 16)
        assert len(await ask(garbage, b"#:GR#")) == 9
        garbage[1].transport.abort()

        for _ in range(10):
            assert len(await ask(steady, b":GR#")) == 9
            await asyncio.sleep(0.02)
        steady[1].close()


async def test_virtual_serial_port_can_be_opened_and_closed_at_will(tmp_path: Path) -> None:
    path = tmp_path / "lx200"
    async with serving(f"lx200@pty:{path}"):
        loop = asyncio.get_running_loop()
        for _ in range(5):
            device = os.open(path, os.O_RDWR | os.O_NOCTTY)
            os.write(device, b":GR#")
            async with asyncio.timeout(PATIENCE):
                heard = await loop.run_in_executor(None, os.read, device, 100)
            assert len(heard) == 9
            os.close(device)
    assert not path.is_symlink()


@each(("model", "reply"), [("lx200gps", b"\x01#"), ("autostar", b"\x00\x00#")])
async def test_nexstar_surface_reports_a_gps_only_if_the_telescope_has_one(model: str, reply: bytes) -> None:
    async with serving("nexstar@tcp://127.0.0.1:0", mount=f"lx200:{model}@sim") as gateway:
        link = await asyncio.open_connection(*address(gateway))
        assert await ask(link, b"P\x01\xb0\x37\x00\x00\x00\x01") == reply
        link[1].close()


@pytest.mark.parametrize("where", ["tcp://", "tcp://127.0.0.1:99999", "tcp://127.0.0.1:x", "/dev/does-not-exist"])
async def test_invalid_or_missing_port_is_reported(where: str) -> None:
    with pytest.raises(UserError, match=where.replace("/", ".")):
        async with serving(f"lx200@{where}"):
            raise AssertionError("opened")
