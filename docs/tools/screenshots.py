"""Makes the pictures of the console in README and docs from the real page on a simulated night.

    python docs/tools/screenshots.py

It writes docs/pictures/*.png, each below 250 kB. It needs the extra ``test`` and Chromium. Gateway, simulated mount and
browser all have the evening of 16 January 2026, so that the pictures are always alike.
"""

from __future__ import annotations

import asyncio
import io
import os
import shutil
import tempfile
import time
from collections.abc import Coroutine
from datetime import UTC, datetime
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any
from unittest.mock import patch

from PIL import Image
from playwright.async_api import Browser, async_playwright

from gateway.app.config import Endpoint, MountConfig, SurfaceConfig
from gateway.app.config.tables import ConsoleConfig
from gateway.app.gateway import Gateway
from gateway.app.simulated import make_simulator
from gateway.astro.ephemeris.keeper import calculate_in_process
from gateway.cli.serve.console_and_broker import load_console
from gateway.core.wire_log import WireLog
from gateway.transport.web_server import WebServer
from gateway.transport.wires import SimulatedTransport

PICTURES = Path(__file__).resolve().parent.parent / "pictures"
EVENING = datetime(2026, 1, 16, 19, 30, tzinfo=UTC).timestamp()
SITE = (48.1, 11.6)
PHONE, TALL, DESK = (390, 844), (390, 1000), (1280, 800)
LARGEST = 250_000
#: The Crab nebula in the east, and a target in Pegasus in the west: a slew between the two takes half a minute.
GOALS = (b":Sr05:34:32#:Sd+22*00:52#:MS#", b":Sr23:05:00#:Sd+28*00:00#:MS#")
TASKS: set[asyncio.Task[None]] = set()
#: Name, size, view, and whether it is night.
SHOTS = (
    ("sky", DESK, "/sky", False),
    ("sky-night", DESK, "/sky", True),
    ("conversation", DESK, "/talk", False),
    ("phone", PHONE, "/sky", False),
    ("phone-night", PHONE, "/control", True),
    ("tonight", TALL, "/sky", False),
    ("target", TALL, "/sky", False),
)
#: What is pressed before a picture is taken.
PRESSED = {"tonight": ["#tonight-button"], "target": ["#tonight-button", "#tonight-rows >> text=M42"]}


async def main() -> None:
    began = time.time()

    def clock() -> float:
        return EVENING + time.time() - began

    def wire(mount: Endpoint, _: MountConfig) -> SimulatedTransport:
        simulator = make_simulator(mount, clock=clock, site=SITE, speed=1.0)
        return SimulatedTransport("sim", simulator.connection, 0.004)

    with tempfile.TemporaryDirectory() as folder:
        config = MountConfig(at="nexstar:cpc@sim", site=SITE, state=folder)
        surfaces = [SurfaceConfig(at="lx200@tcp://127.0.0.1:0")]
        gateway = Gateway(config, surfaces, clock=clock, wire_log=WireLog(clock))
        gateway.sky.use(calculate_in_process([int(EVENING // 86400)]))
        with patch("gateway.app.simulated.simulated_transport", wire):  # the mount has the same evening
            await gateway.open()
        server = WebServer(partial(load_console, ConsoleConfig(), [gateway]))
        port = await server.listen("tcp://127.0.0.1:0")
        await gateway.wait_identified(10.0)
        try:
            await _program(gateway)
            async with async_playwright() as playwright:
                where = os.environ.get("CHROMIUM") or shutil.which("chromium")
                browser = await playwright.chromium.launch(executable_path=where, args=["--no-sandbox"])
                for (name, size, view, night), goal in zip(SHOTS, cycle(GOALS), strict=False):
                    busy = _talk(gateway) if name == "conversation" else _send(gateway, goal)
                    await _shoot(browser, port.address.replace("tcp", "http"), name, size, view, night, busy)
                await browser.close()
        finally:
            await server.close()
            await gateway.close()


async def _program(gateway: Gateway) -> None:
    """Poll the mount like a program."""
    host, port = gateway.ports[0].address.removeprefix("tcp://").split(":")
    reader, writer = await asyncio.open_connection(host, int(port))

    async def poll() -> None:
        while True:
            for command in (b":GR#", b":GD#", b":D#"):
                writer.write(command)
                await reader.readuntil(b"#")
            await asyncio.sleep(0.7)

    TASKS.add(asyncio.ensure_future(poll()))


async def _send(gateway: Gateway, goal: bytes) -> None:
    """Send the mount on a slew that takes a while, like another program."""
    host, port = gateway.ports[0].address.removeprefix("tcp://").split(":")
    reader, writer = await asyncio.open_connection(host, int(port))
    writer.write(goal)
    assert await reader.readexactly(3) == b"110", "the mount does not go there"
    writer.close()


async def _talk(gateway: Gateway) -> None:
    """Send something worth seeing: a refused goto, an arrow, a goto."""
    host, port = gateway.ports[0].address.removeprefix("tcp://").split(":")
    _, writer = await asyncio.open_connection(host, int(port))
    for command in (b":Sr18:37:00#:Sd-70*00:00#", b":MS#", b":RC#:Mn#", b":Qn#", b":Sr06:45:00#:Sd+10*00:00#", b":MS#"):
        await asyncio.sleep(0.9)
        writer.write(command)


async def _shoot(
    browser: Browser, where: str, name: str, size: tuple[int, int], view: str, night: bool,
    busy: Coroutine[Any, Any, None],
) -> None:  # fmt: skip
    """Take a picture of a view this many seconds after something has begun."""
    page = await browser.new_page(viewport={"width": size[0], "height": size[1]}, device_scale_factor=1)
    await page.clock.set_system_time(EVENING + 15.0)
    mode = "night" if night else "day"
    kept = f"localStorage.setItem('light-mode', '{mode}'); localStorage.setItem('light-shown', '{mode}')"
    await page.add_init_script(kept)
    await page.goto(f"{where}/#{view}")
    await asyncio.sleep(4.0)  # the sky is painted, and the line to the mount has some history
    TASKS.add(asyncio.ensure_future(busy))
    await asyncio.sleep(7.0 if view == "/talk" else 4.0)
    for selector in PRESSED.get(name, ()):
        await page.click(selector)
        await asyncio.sleep(1.5)
    picture = Image.open(io.BytesIO(await page.screenshot())).convert("RGB")
    await page.close()
    PICTURES.mkdir(exist_ok=True)
    path = PICTURES / f"{name}.png"
    picture.quantize(colors=256, dither=Image.Dither.NONE).save(path, optimize=True)
    assert path.stat().st_size < LARGEST, f"{path}: {path.stat().st_size} bytes"
    print(path.name, path.stat().st_size)


if __name__ == "__main__":
    asyncio.run(main())
