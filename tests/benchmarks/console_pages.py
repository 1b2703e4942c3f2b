"""Pages of a console, in a process of their own, so that their cost does not count as the gateway's.

    python tests/benchmarks/console_pages.py URL PAGES [--chromium]

``PAGES`` WebSockets that read everything and send a heartbeat twice a second; with ``--chromium`` one of them is the
real page in a real browser. It prints ``open`` once all are connected, and runs until its standard input is closed. It
has a lower priority than the measured processes, because it stands for other computers.
"""

from __future__ import annotations

import asyncio
import os
import sys
import time

import aiohttp

BEAT = 0.5


async def show(http: aiohttp.ClientSession, where: str, token: str) -> None:
    """Run one page."""
    beat = 0.0
    async with http.ws_connect(f"{where}socket?token={token}") as ws:
        async for _ in ws:
            if time.perf_counter() - beat > BEAT:
                beat = time.perf_counter()
                await ws.send_str('{"do":"beat"}')


async def browse(where: str, opened: asyncio.Event) -> None:
    """Open the page in a browser, as a person does."""
    from playwright.async_api import async_playwright

    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        page = await browser.new_page(viewport={"width": 390, "height": 844})
        await page.goto(where)
        opened.set()
        await asyncio.Event().wait()


async def main(where: str, many: int, chromium: bool) -> None:
    opened = asyncio.Event()
    async with aiohttp.ClientSession() as http:
        text = await (await http.get(where)).text()
        token = text.split('name="token" content="')[1].split('"')[0]
        tasks = [asyncio.ensure_future(show(http, where, token)) for _ in range(many - chromium)]
        if chromium:
            tasks.append(asyncio.ensure_future(browse(where, opened)))
            await opened.wait()
        print("open", flush=True)
        await asyncio.to_thread(sys.stdin.read)
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks, timeout=5.0)


if __name__ == "__main__":
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    os.setpriority(os.PRIO_PROCESS, 0, 10)
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), "--chromium" in sys.argv))
