"""How soon a page is ready on a slow network: seconds until it shows the mount, over a proxy that delays every byte.

The proxy also makes a connection wait for a round trip, as the network does before the first byte of a request.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

from playwright.async_api import Browser, async_playwright

from tests.benchmarks.figures import middle

#: Seconds of a round trip.
ROUND_TRIP = 0.15
SHOWS = """new Promise((done) => {
  const look = () => document.querySelector("#name")?.textContent.startsWith("Celestron")
    ? done(performance.now() / 1000) : requestAnimationFrame(look);
  look();
})"""


async def _late(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Pass on what comes half a round trip later, however much is on its way."""
    loop, under_way = asyncio.get_running_loop(), asyncio.Queue[tuple[float, bytes]]()

    async def deliver() -> None:
        while True:
            due, data = await under_way.get()
            await asyncio.sleep(max(0.0, due - loop.time()))
            if not data:
                writer.close()
                return
            writer.write(data)

    delivering = asyncio.create_task(deliver())
    data = b"-"
    while data:
        with contextlib.suppress(ConnectionError):
            data = await reader.read(65536)
        under_way.put_nowait((loop.time() + ROUND_TRIP / 2, data))
    await delivering


@contextlib.asynccontextmanager
async def far_away(port: int) -> AsyncIterator[int]:
    """Let a port of this computer be a round trip away; yield the port where it is."""

    async def connect(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await asyncio.sleep(ROUND_TRIP)
        there, back = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.gather(_late(reader, back), _late(there, writer), return_exceptions=True)

    async with await asyncio.start_server(connect, "127.0.0.1", 0) as server:
        yield server.sockets[0].getsockname()[1]


async def _visit(browser: Browser, where: str) -> tuple[float, int]:
    context = await browser.new_context(viewport={"width": 390, "height": 844})
    page = await context.new_page()
    await page.goto(where)
    seconds = await page.evaluate(SHOWS)
    await page.wait_for_timeout(1000)  # the stars of the chart come after that
    loaded = "[...performance.getEntriesByType('navigation'), ...performance.getEntriesByType('resource')]"
    size = await page.evaluate(f"{loaded}.reduce((sum, one) => sum + one.transferSize, 0)")
    await context.close()
    return float(seconds), int(size)


async def tell_ready(where: str, visits: int) -> None:
    """Print how soon first visits of this console are ready, here and far away, and how much they load."""
    port = int(where.rstrip("/").rpartition(":")[2])
    async with far_away(port) as far, async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        for words, at, goal in (("on this computer", port, ""), (f"over {ROUND_TRIP} s", far, " (goal 1.00)")):
            found = [await _visit(browser, f"http://127.0.0.1:{at}/") for _ in range(visits)]
            seconds = [took for took, _ in found]
            print(f"a first visit {words}: ready after {middle(seconds):.2f} s, at most {max(seconds):.2f} s{goal}; "
                  f"{found[-1][1] / 1000:.0f} kB (goal 150)", flush=True)  # fmt: skip
        await browser.close()
