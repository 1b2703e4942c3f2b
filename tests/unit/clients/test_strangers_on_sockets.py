"""Strangers on real sockets: the page is read to its end however the request comes, and the connection is closed."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.gateway import Gateway
from gateway.transport import tcp
from tests.support.greetings import GREETINGS
from tests.unit.transport.test_ports import ask

pytestmark = pytest.mark.real_time
SURFACES = (
    "lx200@tcp://127.0.0.1:0",
    "nexstar@tcp://127.0.0.1:0",
    "lx200@rfc2217://127.0.0.1:0",
    "nexstar@rfc2217://127.0.0.1:0",
)
PLACES = 30


@contextlib.asynccontextmanager
async def serving(**settings: int) -> AsyncIterator[tuple[list[int], list[str]]]:
    """The ports of a gateway with all four surfaces, and the log's notes."""
    gateway = Gateway(MountConfig(at="nexstar@sim"), [SurfaceConfig(at=at, **settings) for at in SURFACES])
    said: list[str] = []
    gateway.wire_log.sinks.append(
        lambda entry: said.append(f"{entry.side} {entry.note}") if entry.arrow == "!" else None
    )
    await gateway.open()
    try:
        async with asyncio.timeout(60):
            assert await gateway.wait_identified(10)
            yield [int(port.address.rpartition(":")[2]) for port in gateway.ports], said
    finally:
        await gateway.close()


async def visit(port: int, data: bytes, size: int, pause: float = 0.0) -> tuple[bytes, str]:
    """Send a request in pieces, whatever becomes of it -> all that was answered to the very end, and who asked."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    host, number = writer.get_extra_info("sockname")

    async def send() -> None:
        with contextlib.suppress(ConnectionError):
            for at in range(0, len(data), size):
                writer.write(data[at : at + size])
                await writer.drain()
                await asyncio.sleep(pause)

    sending = asyncio.create_task(send())
    answer = await reader.read()
    await sending
    writer.close()
    return answer, f"{host}:{number}"


def whole(answer: bytes) -> str:
    """The text of an HTTP answer that is complete, by its own count."""
    head, _, text = answer.partition(b"\r\n\r\n")
    lines = head.split(b"\r\n")
    fields = {name.lower(): value.strip() for name, _, value in (line.partition(b":") for line in lines[1:])}
    assert lines[0].startswith(b"HTTP/1.1 4"), lines[0]
    assert fields[b"connection"] == b"close" and int(fields[b"content-length"]) == len(text)
    assert not any(name.startswith(b"access-control") for name in fields)
    return text.decode()


async def test_browser_gets_an_explanation_and_the_next_program_is_answered() -> None:
    async with serving(max_clients=PLACES) as (ports, said):
        for port, speaks in zip(ports, ("LX200", "NexStar", "LX200", "NexStar"), strict=True):
            for size, pause in ((1000, 0.0), (1, 0.002)):
                request = GREETINGS["a form"] if size > 1 else GREETINGS["a form"][:50]
                answer, who = await visit(port, request, size, pause)
                assert f"telescope programs that speak {speaks}" in whole(answer), answer
                assert [line for line in said if line.startswith(f"{who} sends an HTTP request; ")]
            link = await asyncio.open_connection("127.0.0.1", port)
            assert len(await ask(link, b"e" if speaks == "NexStar" else b":GR#")) in (9, 18)
            link[1].close()


async def test_large_request_of_a_web_client_is_answered_to_the_end() -> None:
    """What is never read would have the system reset the connection, and the browser show nothing."""
    async with serving() as (ports, _):
        body = b"#:Me#" * 20_000
        request = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n%s" % (len(body), body)
        answer, _ = await visit(ports[0], request, 4096)
        assert "telescope programs" in whole(answer)
        assert "telescope programs" in whole((await visit(ports[1], b"OPTIONS * HTTP/1.0\r\n\r\n", 64))[0])


async def test_web_client_that_does_not_leave_is_disconnected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tcp, "LINGER_TIME", 0.2)
    async with serving() as (ports, _):
        reader, writer = await asyncio.open_connection("127.0.0.1", ports[1])
        writer.write(GREETINGS["TLS"])
        assert await reader.read() == b""
        with pytest.raises(ConnectionError):  # noqa: PT012 - the system tells on one of the next writes
            for _ in range(3000):
                writer.write(b"x")
                await writer.drain()
                await asyncio.sleep(0.02)


async def test_web_clients_do_not_use_up_the_client_limit_of_a_port() -> None:
    """They are not counted among the clients, though they have not left yet."""
    async with serving(max_clients=PLACES) as (ports, _):
        strangers = []
        for _ in range(2 * PLACES):
            link = await asyncio.open_connection("127.0.0.1", ports[0])
            link[1].write(b"GET / HTTP/1.0\r\n\r\n")
            strangers.append(link)
            await link[0].read(10)
        friend = await asyncio.open_connection("127.0.0.1", ports[0])
        assert len(await ask(friend, b":GR#")) == 9
        for link in [*strangers, friend]:
            link[1].close()
