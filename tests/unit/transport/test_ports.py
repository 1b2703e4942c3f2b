"""Where clients come in: what one does to its connection never reaches another."""

from __future__ import annotations

import asyncio
import os
import socket
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.core.errors import UserError

PATIENCE = 60.0


def serve(program: Callable[[Gateway], Awaitable[None]], *surfaces: str, mount: str = "nexstar@sim") -> None:
    """Run a program against a gateway with a simulated mount and real ports."""

    async def main() -> None:
        gateway = Gateway(MountConfig(at=mount), [SurfaceConfig(at=surface) for surface in surfaces])
        await gateway.open()
        try:
            assert await gateway.wait_identified(PATIENCE)
            async with asyncio.timeout(60):
                await program(gateway)
        finally:
            await gateway.close()

    asyncio.run(main())


def address(gateway: Gateway, index: int = 0) -> tuple[str, int]:
    host, _, port = gateway.ports[index].where.removeprefix("tcp://").rpartition(":")
    return host, int(port)


async def ask(link: tuple[asyncio.StreamReader, asyncio.StreamWriter], data: bytes, until: bytes = b"#") -> bytes:
    link[1].write(data)
    async with asyncio.timeout(PATIENCE):
        return await link[0].readuntil(until)


def test_clients_come_and_go_and_misbehave_without_reaching_another() -> None:
    async def program(gateway: Gateway) -> None:
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

    serve(program, "lx200@tcp://127.0.0.1:0")


def test_a_virtual_serial_port_can_be_opened_and_closed_at_will(tmp_path: Path) -> None:
    path = tmp_path / "lx200"

    async def program(gateway: Gateway) -> None:
        loop = asyncio.get_running_loop()
        for _ in range(5):
            device = os.open(path, os.O_RDWR | os.O_NOCTTY)
            os.write(device, b":GR#")
            async with asyncio.timeout(PATIENCE):
                heard = await loop.run_in_executor(None, os.read, device, 100)
            assert len(heard) == 9
            os.close(device)

    serve(program, f"lx200@pty:{path}")
    assert not path.is_symlink()


def test_a_gps_unit_is_presented_where_the_telescope_has_one() -> None:
    linked = b"P\x01\xb0\x37\x00\x00\x00\x01"

    async def program(gateway: Gateway) -> None:
        link = await asyncio.open_connection(*address(gateway))
        assert await ask(link, linked) == b"\x01#"
        link[1].close()

    async def without(gateway: Gateway) -> None:
        link = await asyncio.open_connection(*address(gateway))
        assert await ask(link, linked) == b"\x00\x00#"
        link[1].close()

    serve(program, "nexstar@tcp://127.0.0.1:0", mount="lx200:lx200gps@sim")
    serve(without, "nexstar@tcp://127.0.0.1:0", mount="lx200:autostar@sim")


@pytest.mark.parametrize("where", ["tcp://", "tcp://127.0.0.1:99999", "tcp://127.0.0.1:x", "/dev/does-not-exist"])
def test_a_port_that_cannot_be_is_said(where: str) -> None:
    async def program(gateway: Gateway) -> None:
        raise AssertionError("opened")

    with pytest.raises(UserError, match=where.replace("/", ".")):
        serve(program, f"lx200@{where}")
