"""A stranger's bytes make no noise on the terminal; what goes wrong in the web server itself does."""

from __future__ import annotations

import asyncio
import logging

import pytest
from aiohttp import web

from gateway.transport.web_server import web_log


@pytest.mark.parametrize(
    ("request_", "status", "told"),
    [
        (b"PUT /api/v1/telescope/0/abortslew HTTP/1.1\r\nContent-Length: 0\r\n\r\n", b" 400 ", False),
        (b"GET / HTTP/1.1\r\nno header\r\n\r\n", b" 400 ", False),
        (b"GET /broken HTTP/1.1\r\nHost: here\r\n\r\n", b" 500 ", True),
    ],
)
def test_web_log_reports_server_errors_but_no_bad_requests(
    request_: bytes, status: bytes, told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    async def broken(request: web.Request) -> web.Response:
        raise ZeroDivisionError

    async def work() -> bytes:
        app = web.Application()
        app.add_routes([web.get("/broken", broken)])
        runner = web.AppRunner(app, access_log=None, logger=web_log(), shutdown_timeout=0.1)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        host, port = runner.addresses[0][:2]
        reader, writer = await asyncio.open_connection(host, port)
        writer.write(request_)
        line = await asyncio.wait_for(reader.readline(), 60.0)
        writer.close()
        await runner.cleanup()
        return line

    with caplog.at_level(logging.DEBUG, "gateway.web"):
        assert status in asyncio.run(work())
    assert bool(caplog.records) is told
