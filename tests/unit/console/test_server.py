"""The console's web server, spoken to as browsers do, and as a page of somebody else's would."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Coroutine, Sequence
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import aiohttp
import pytest

from gateway.app.config import MountConfig, SurfaceConfig
from gateway.app.config.tables import ConsoleConfig
from gateway.app.gateway import Gateway
from gateway.app.mount_state import mount_state
from gateway.cli.serve.console_and_broker import load_console
from gateway.console.server import MAX_MESSAGE_BYTES, MAX_PAGES
from gateway.transport.room import RESERVED_PLACES
from gateway.transport.web_server import WebServer

pytestmark = pytest.mark.real_time
PATIENCE = 60.0


class Page:
    """A page's WebSocket: what it is shown."""

    def __init__(self, ws: aiohttp.ClientWebSocketResponse) -> None:
        self.ws = ws
        self.mount: dict[str, Any] = {}
        self.rows: list[dict[str, Any]] = []
        self.recordings: list[Any] = []
        self._number = 0

    async def take(self) -> dict[str, Any]:
        message = await self.ws.receive(timeout=PATIENCE)
        assert message.type is aiohttp.WSMsgType.TEXT, message
        value: dict[str, Any] = json.loads(message.data)
        if "mounts" in value:
            [self.mount], self.recordings = value["mounts"], value["recordings"]
        self.rows += value.get("talk", [])
        return value

    async def ask(self, do: str, **more: Any) -> dict[str, Any]:
        self._number += 1
        await self.ws.send_str(json.dumps({"do": do, "id": self._number, **more}))
        while (value := await self.take()).get("id") != self._number:
            pass
        return value

    async def until(self, holds: Callable[[], Any]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not holds():
                await self.take()


class Open:
    """A gateway over a simulated mount, its console, and a browser."""

    def __init__(self, gateway: Gateway, http: aiohttp.ClientSession, where: str) -> None:
        self.gateway, self.http, self.where = gateway, http, where

    async def token(self) -> str:
        async with self.http.get(self.where) as response:
            assert response.status == 200
            return (await response.text()).split('name="token" content="')[1].split('"')[0]

    @asynccontextmanager
    async def page(self) -> AsyncIterator[Page]:
        async with self.http.ws_connect(f"{self.where}socket?token={await self.token()}") as ws:
            page = Page(ws)
            await page.until(lambda: page.mount.get("site") and page.mount["position"])
            yield page


@asynccontextmanager
async def at_port(gateways: Sequence[Gateway], **page: Any) -> AsyncIterator[str]:
    """Open a console at a port; yield the address of its page."""
    server = WebServer(partial(load_console, ConsoleConfig(**page), gateways))
    port = await server.listen("tcp://127.0.0.1:0")
    try:
        yield port.address.replace("tcp", "http") + "/"
    finally:
        await server.close()


@asynccontextmanager
async def opened(state: Path, page: dict[str, Any] | None = None, **mount: Any) -> AsyncIterator[Open]:
    config = MountConfig(**({"at": "nexstar@sim", "speed": 6.0, "sun": 0.0, "state": str(state)} | mount))
    gateway = Gateway(config, [SurfaceConfig(at="lx200@tcp://127.0.0.1:0")], warn=lambda text: None)
    await gateway.open()
    try:
        assert await gateway.wait_identified(PATIENCE)
        async with at_port([gateway], **page or {}) as where, aiohttp.ClientSession() as http:
            yield Open(gateway, http, where)
    finally:
        await gateway.close()


def told(gateway: Gateway) -> list[str]:
    """Return what ``status`` tells of refused requests, without the time."""
    lately = mount_state(gateway.controller).to_state().lately
    return [line.partition("ago, ")[2] for line in lately if "over HTTP" in line]


def play(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


# --- who is let in --------------------------------------------------------------------------------------------------


#: What a page of somebody else's sends, and asks for.
OTHERS: list[tuple[dict[str, str], str]] = [
    ({"Host": "evil.example"}, ""),
    ({"Host": "evil.example"}, "socket?token=x"),
    ({"Origin": "http://evil.example"}, ""),
    ({"Sec-Fetch-Site": "cross-site"}, "socket"),
    ({}, "socket"),
    ({}, "socket?token=wrong"),
    ({}, "recording/0/a.rec?token=wrong"),
]


async def test_console_refuses_a_foreign_page(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        for headers, path in OTHERS:
            async with there.http.get(there.where + path, headers=headers) as response:
                assert response.status == 403, (headers, path)


async def test_console_page_cannot_be_framed_and_runs_only_its_scripts(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.http.get(there.where) as response:
        policy = response.headers["Content-Security-Policy"]
        assert "frame-ancestors 'none'" in policy and "default-src 'none'" in policy and "unsafe" not in policy
        assert response.headers["X-Frame-Options"] == "DENY"
        assert "Access-Control-Allow-Origin" not in response.headers
        assert "Set-Cookie" not in response.headers


async def test_console_serves_only_its_files(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        for path in ("nothing", "../server.py", "%2e%2e/server.py", "js/../../server.py", "recording/0/x"):
            async with there.http.get(f"{there.where}{path}") as response:
                assert response.status in (403, 404), path


async def test_console_refuses_clients_outside_allow(tmp_path: Path) -> None:
    async with opened(tmp_path, {"allow": ["192.0.2.0/24"]}) as there:
        for _ in range(3):
            async with there.http.get(there.where) as response:
                assert response.status == 403
        assert len(told(there.gateway)) == 1 and "not in the console's allow" in told(there.gateway)[0]


async def test_status_names_a_host_name_that_the_console_refused(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        for name in ("pier.example", "other.example"):  # not repeated: a flood of names would hide all else
            async with there.http.get(there.where, headers={"Host": name}) as response:
                assert response.status == 403
        assert len(told(there.gateway)) == 1 and "not in names" in told(there.gateway)[0]


async def test_huge_message_ends_only_its_page(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        async with there.page() as page:
            with contextlib.suppress(ConnectionError):
                await page.ws.send_str("x" * (MAX_MESSAGE_BYTES * 640))
            async with asyncio.timeout(PATIENCE):
                while (await page.ws.receive()).type is aiohttp.WSMsgType.TEXT:
                    pass
        async with there.page() as page:
            assert (await page.ask("look_up", name="Vega"))["name"] == "Vega"


ODD = ("", "{", "[]", "null", '{"do":"fly","id":99}', '{"do":"jog","id":99}', "\x00", '"' * 99,
       '{"do":"goto","id":99,"ra":1e999,"dec":0}', '{"do":"stop","mount":-9}')  # fmt: skip


async def test_malformed_page_messages_have_no_effect(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        for text in ODD:
            async with there.page() as page:
                await page.ws.send_str(text)
                assert (await page.ask("look_up", name="Vega"))["ok"], text


async def test_invalid_page_message_is_answered_with_an_error(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        for do, fields in (
            ("fly", {}), ("site", {"latitude": 95.0, "longitude": 0.0}), ("look_up", {"name": "x" * 300}),
            ("stop", {"mount": -9}), ("jog", {"direction": "up"}),
        ):  # fmt: skip
            answer = await page.ask(do, **fields)
            assert not answer["ok"] and "does not understand" in answer["words"], do


def test_page_beyond_the_limit_is_told_to_come_later(tmp_path: Path) -> None:
    """Two places are for another address; a page that goes leaves its place."""

    async def work() -> None:
        async with opened(tmp_path) as there, contextlib.AsyncExitStack() as stack:
            where = f"{there.where}socket?token={await there.token()}"

            async def connect() -> Page:
                return Page(await stack.enter_async_context(there.http.ws_connect(where)))

            pages = [await connect() for _ in range(MAX_PAGES - RESERVED_PLACES)]
            with pytest.raises(AssertionError, match=r"CLOSE.*1013"):
                await (await connect()).until(lambda: False)
            await pages.pop().ws.close()
            pages.append(await connect())
            assert all([(await page.ask("stop"))["id"] for page in pages[-2:]])
            await asyncio.gather(*(page.ws.close() for page in pages))

    play(work())


# --- what a page sees and does --------------------------------------------------------------------------------------


async def test_page_shows_a_goto_until_the_mount_arrives(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        start = page.mount["position"]
        goal = {"ra": (start["ra2000"] + 15.0) % 360.0, "dec": start["dec2000"] + 10.0}
        answer = await page.ask("goto", **goal, j2000=True)
        assert answer["ok"], answer
        await page.until(lambda: page.mount["slewing"] and page.mount["target"])
        assert page.mount["target"]["dec2000"] == pytest.approx(goal["dec"], abs=0.01)
        await page.until(lambda: not page.mount["slewing"])
        await page.until(lambda: abs(page.mount["position"]["dec2000"] - goal["dec"]) < 0.05)


async def test_page_goto_below_the_horizon_is_refused_in_words(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        below = {"ra": page.mount["position"]["ra2000"], "dec": -80.0}
        asked = await page.ask("ask", **below, j2000=True)
        assert asked["may"] is False and "below the horizon" in asked["why"]
        answer = await page.ask("goto", **below)
        assert not answer["ok"] and "below the horizon" in answer["words"]
        await page.until(lambda: any("below" in line for line in page.mount["lately"]))


@pytest.mark.parametrize("how", ["closed", "silent", "cut off"])
async def test_closed_page_keeps_no_arrow_alive(tmp_path: Path, how: str) -> None:
    async with opened(tmp_path) as there, there.page() as watcher, there.page() as page:
        await page.ask("jog", direction="east", rate=7)
        await watcher.until(lambda: watcher.mount["by_hand"])
        if how == "closed":
            await page.ws.close()
        elif how == "cut off":
            assert page.ws._response.connection is not None
            page.ws._response.connection.transport.abort()
        loop = asyncio.get_running_loop()
        began = loop.time()
        await watcher.until(lambda: not watcher.mount["by_hand"])
        assert loop.time() - began < 3.5


async def test_open_page_keeps_its_arrow_alive(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        await page.ask("jog", direction="west", rate=2, press=1)
        loop = asyncio.get_running_loop()
        began = loop.time()
        while loop.time() < began + 2.2:
            await page.ws.send_str('{"do":"beat","held":[{"mount":0,"direction":"west","press":1}]}')
            await page.take()
        assert page.mount["by_hand"]


async def test_page_stop_ends_all_motion_and_hold_keeps_the_mount_still(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        await page.ask("jog", direction="north", rate=5)
        stopped = await page.ask("stop")
        assert stopped["ok"] and stopped["words"] == "stopped"
        await page.until(lambda: not page.mount["by_hand"])
        assert (await page.ask("hold"))["words"] == "stopped and held"
        await page.until(lambda: page.mount["held"])
        refused = await page.ask("jog", direction="north", rate=5)
        assert not refused["ok"] and "held" in refused["words"]
        assert (await page.ask("release"))["ok"]
        await page.until(lambda: not page.mount["held"])


async def test_page_sets_tracking_time_and_site_as_programs_do(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        assert (await page.ask("track", on=False))["ok"]
        await page.until(lambda: page.mount["tracks"] is False)
        assert (await page.ask("track", on=True))["ok"]
        await page.until(lambda: page.mount["tracks"])
        assert (await page.ask("time", unix=1768514400.0, offset=1.0))["ok"]
        assert (await page.ask("site", latitude=48.1, longitude=11.6))["ok"]


async def test_page_narrows_limits_and_restores_them(tmp_path: Path) -> None:
    async with opened(tmp_path, lowest=10.0, hour_angle_limit=3.0) as there, there.page() as page:
        low = {"ra": page.mount["position"]["ra2000"], "dec": page.mount["position"]["dec2000"], "j2000": True}
        for wider in ({"lowest": 5.0}, {"highest": 80.0, "hour_angle": 60.0}):
            refused = await page.ask("narrow", **wider)
            assert not refused["ok"] and "10° to 90°, no more than 3 h" in refused["words"]
        assert not (await page.ask("narrow", lowest=60.0, highest=60.0))["ok"]
        assert (await page.ask("narrow", lowest=80.0))["ok"]
        refused = await page.ask("goto", **low)
        assert not refused["ok"] and "narrowed the limits" in refused["words"]
        await page.until(lambda: page.mount["limits"]["by_page"] and page.mount["own_limits"].startswith("altitude 10"))
        assert "altitude 80° to 90°" in page.mount["allowed"]
        assert (await page.ask("narrow", sun=30.0, hour_angle=15.0))["words"] == (
            "allowed now: altitude 10° to 90°, no nearer to the Sun than 30°, no more than 1 h past the meridian"
        )
        assert there.gateway.controller.suns.min_dist == 30.0
        assert (await page.ask("narrow"))["ok"] and (await page.ask("goto", **low))["ok"]
        await page.until(lambda: not page.mount["limits"]["by_page"])


async def test_page_shows_the_pier_side_of_a_german_mount_and_guides_it(tmp_path: Path) -> None:
    async with opened(tmp_path, at="nexstar:cge@sim") as there, there.page() as page:
        offered = {"Goto", "Move", "Park", "Pulse", "SetGuideRate", "SetTracking", "Sync", "TrackRate"}
        assert offered == set(page.mount["can"]), "it has no home position"
        assert (await page.ask("track", on=True, rate="lunar"))["ok"]
        told = json.loads((await page.ask("look"))["words"])
        assert told["pier"] in ("E", "W") and told["drive"] == pytest.approx(0.9763, abs=0.001)
        await page.until(lambda: page.mount["pier"] == told["pier"])
        assert (await page.ask("guide_rate", rate=0.75))["ok"]
        await page.until(lambda: page.mount["guides"] == [0.75, 0.75])
        assert (await page.ask("guide", direction="n", ms=500))["ok"]
        assert not (await page.ask("guide", direction="n", ms=99999))["ok"]


async def test_page_without_its_pin_can_only_look_and_stop(tmp_path: Path) -> None:
    async with opened(tmp_path, {"pin": "4711"}) as there, there.page() as page:
        refused = await page.ask("park")
        assert not refused["ok"] and "pin" in refused["words"]
        assert (await page.ask("stop"))["ok"]
        assert not (await page.ask("pin", pin="4712"))["ok"]
        assert (await page.ask("pin", pin="4711"))["ok"]
        assert (await page.ask("jog", direction="north", rate=3))["ok"]


async def test_wrong_pin_delays_further_tries_but_never_a_stop(tmp_path: Path) -> None:
    async with opened(tmp_path, {"pin": "4711"}) as there, there.page() as page:
        notes: list[str] = []
        there.gateway.wire_log.sinks.append(lambda entry: notes.append(entry.note))
        answers = [await page.ask("pin", pin="0000") for _ in range(6)]
        assert [answer["words"] for answer in answers[:5]] == ["this is not the pin"] * 5
        assert "wait 60 s" in answers[5]["words"]
        assert not (await page.ask("pin", pin="4711"))["ok"]
        assert (await page.ask("stop"))["ok"]
        assert sum("wrong pin from 127.0.0.1" in note for note in notes) == 5


async def test_console_conversation_shows_related_rows_together_as_text(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        host, port = there.gateway.ports[0].address.removeprefix("tcp://").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(b":GR#")
        await reader.readuntil(b"#")
        await page.ws.send_str('{"do":"talk","on":true}')  # of a program that was there before
        await page.ask("search")
        writer.write(b"<i>#rubbish#:GR#:<b>x</b>#")
        await reader.readuntil(b"#")
        await page.until(lambda: any("<b>" in row["data"] for row in page.rows))
        asked = next(row for row in page.rows if row["data"] == ":GR#" and row["arrow"] == ">")
        answered = next(row for row in page.rows if row["side"] == asked["side"] and row["arrow"] == "<")
        assert asked["pair"] == answered["pair"]
        assert asked["words"] and answered["words"] and not {asked["kind"], answered["kind"]} & {"no"}
        assert {row["surface"] for row in page.rows if row["side"] == asked["side"]} == {"lx200:autostar"}
        assert not any("nexstar" in row["words"] for row in page.rows if row["side"] == asked["side"])
        await page.until(lambda: page.mount["programs"])
        assert page.mount["programs"][0]["surface"].startswith("lx200:")
        writer.close()


async def test_console_starts_ends_and_serves_a_recording(tmp_path: Path) -> None:
    async with opened(tmp_path) as there, there.page() as page:
        assert (await page.ask("record", on=True))["ok"]
        await page.until(lambda: page.recordings and page.recordings[0])
        assert not (await page.ask("record", on=True))["ok"]
        await page.ask("jog", direction="north", rate=4)
        await page.ask("stop")
        answer = await page.ask("record", on=False)
        assert answer["ok"], answer
        path = f"{there.where}{answer['download'][1:]}?token={await there.token()}"
        async with there.http.get(path) as response:
            assert response.status == 200 and "attachment" in response.headers["Content-Disposition"]
            assert (await response.text()).startswith("# mount-gateway")
        assert not (await page.ask("record", on=False))["ok"]
        path = f"{there.where}{answer['report'][1:]}?token={await there.token()}"
        async with there.http.get(path) as response:
            assert response.status == 200 and response.content_type == "text/html", await response.text()
            assert "attachment" in response.headers["Content-Disposition"]


async def test_page_that_reads_nothing_delays_nobody(tmp_path: Path) -> None:
    async with opened(tmp_path) as there:
        _, writer = await asyncio.open_connection("127.0.0.1", urlsplit(there.where).port, limit=1024)
        key = "dGhlIHNhbXBsZSBub25jZQ=="
        writer.write(
            f"GET /socket?token={await there.token()} HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        async with there.page() as page:
            for _ in range(5):
                assert (await page.ask("look_up", name="Vega"))["ok"]
        writer.close()
