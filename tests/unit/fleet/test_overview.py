"""The overview's web server, spoken to as its page does, and as a page of somebody else's would."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import aiohttp
import pytest

from gateway.console.server import PAGE_FOLDER
from gateway.fleet.overview import server as servers
from gateway.fleet.overview.server import OverviewServer
from tests.support.fake_broker import NOWHERE, FakeBroker, until

pytestmark = pytest.mark.real_time


class There:
    """An overview, its broker, and a browser that has its page."""

    def __init__(self, http: aiohttp.ClientSession) -> None:
        self.broker, self.http, self.told = FakeBroker(), http, list[bool]()
        self.page = OverviewServer(
            NOWHERE, "club", PAGE_FOLDER, lambda: 0.0, lambda there, why: self.told.append(there), self.broker.connect
        )
        self.token = ""

    async def get(self, path: str, **headers: str) -> aiohttp.ClientResponse:
        return await self.http.get(self.page.address + path, headers={"X-Token": self.token, **headers})

    async def stop(self, body: object, **headers: str) -> tuple[int, Any]:
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        where = f"{self.page.address}stop"
        async with self.http.post(where, data=data, headers={"X-Token": self.token, **headers}) as answer:
            return answer.status, json.loads(await answer.text()) if answer.status == 200 else await answer.text()


@asynccontextmanager
async def opened() -> AsyncIterator[There]:
    async with aiohttp.ClientSession() as http:
        there = There(http)
        await there.page.open(0)
        try:
            await until(lambda: there.told)
            text = await (await there.get("")).text()
            there.token = text.split('name="token" content="')[1].split('"')[0]
            yield there
        finally:
            await there.page.close()


def play(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


async def test_fleet_server_serves_only_its_page_and_files() -> None:
    async with opened() as there:
        text = await (await there.get("")).text()
        needed = re.findall(r'(?:href|src)="([^"]+)"', text)
        assert [name.rpartition("/")[2] for name in needed] == ["icon.svg", "all.js"]
        for name in needed:
            assert (await there.get(name)).status == 200
        assert (await there.get("js/core/dom.js")).status == 200
        for other in ("server.py", "js/main.js", "../server.py", "%2e%2e/server.py"):
            assert (await there.get(other)).status == 404
        policy = (await there.get("")).headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "unsafe" not in policy


def test_fleet_server_sends_its_page_every_mount_on_the_broker() -> None:
    async def work() -> None:
        async with opened() as there:
            there.broker.say("club/pier/mount/state", b'{"online": true, "does": "tracking"}', True)

            async def shown() -> Any:
                return json.loads(await (await there.get("fleet.json")).text())

            async with asyncio.timeout(5.0):
                while not (told := await shown())["mounts"]:
                    await asyncio.sleep(0.01)
            assert told["there"] is True and told["mounts"][0]["does"] == "tracking"
            there.broker.down = OSError(111, "Connection refused")
            there.broker.lose()
            await until(lambda: False in there.told)
            assert (await shown())["there"] is False

    play(work())


@pytest.mark.parametrize(
    ("body", "topic"), [({}, "club/all/command"), ({"gateway": "pier", "mount": "east"}, "club/pier/east/command")]
)
async def test_fleet_stop_is_confirmed_once_the_broker_has_passed_it_on(body: dict[str, str], topic: str) -> None:
    async with opened() as there:
        there.broker.passes_on = True
        assert await there.stop(body) == (200, {"sent": True, "words": "stop sent"})
        [message] = there.broker.published
        assert (message.topic, message.payload, message.retain) == (topic, b"stop", False)


async def test_fleet_stop_that_was_not_delivered_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(servers, "ECHO_TIMEOUT", 0.05)
    async with opened() as there:
        code, told = await there.stop({})
        assert code == 200 and told["sent"] is False and "has not passed it on" in told["words"]
        there.broker.down = OSError(111, "Connection refused")
        there.broker.lose()
        await until(lambda: False in there.told)
        published = len(there.broker.published)
        code, told = await there.stop({})
        assert told["sent"] is False and "STOP WAS NOT SENT" in told["words"]
        there.broker.down = None
        await until(lambda: there.told[-1])
        assert len(there.broker.published) == published, "it is not sent later, when nobody expects it"


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", {"gateway": "a"}, {"mount": "a"}, {"gateway": "a/b", "mount": "c"}, {"gateway": "#", "mount": "+"},
     {"gateway": "a", "mount": "b", "order": "park"}],
)  # fmt: skip
async def test_fleet_stop_without_a_mount_is_refused(body: object) -> None:
    async with opened() as there:
        assert (await there.stop(body))[0] == 400 and not there.broker.published


@pytest.mark.parametrize(
    "headers",
    [
        {"X-Token": "guess"},
        {"Host": "evil.example"},
        {"Origin": "http://evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
    ],
)
async def test_foreign_page_sees_and_stops_nothing_at_the_fleet_server(headers: dict[str, str]) -> None:
    async with opened() as there:
        assert (await there.get("fleet.json", **headers)).status == 403
        assert (await there.stop({}, **headers))[0] == 403 and not there.broker.published
