"""The web server of the overview: its page, what it shows, and STOP.

Whatever comes in passes the console's gate: an address or name of this computer, the page itself, and the token that
only the served page holds. A stop counts as sent when the broker has passed it on, which is heard here.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable
from pathlib import Path

import msgspec
from aiohttp import web
from msgspec import Struct

from gateway.console.pages import Pages, guarded, listen, of_the_page, runner_of, same_token
from gateway.console.server import PAGE
from gateway.fleet.client import Access, Connect
from gateway.fleet.link import BrokerLink
from gateway.fleet.overview.roster import Roster
from gateway.fleet.topics import Heard, Message, Topics
from gateway.system.own_names import known_host

OWN = Path(__file__).parent / "page"
#: What is taken from the console's page.
SHARED = ("css/tokens.css", "css/base.css", "js/first.js", "js/core/dom.js", "icon.svg")
#: Seconds within which a broker passes a message on; messages a second of 1,000 mounts, and some.
PASSED_ON, FLOOD = 3.0, 5000
#: Said where a stop did not get through.
UNSENT = "STOP WAS NOT SENT: {why}. Use mount-gateway stop at the mount's computer, its keys, or its power switch."


class Stop(Struct, frozen=True, forbid_unknown_fields=True):
    """Which mount; both empty: all of them."""

    gateway: str = ""
    mount: str = ""


class Overview:
    """Serves until it is closed. ``warn`` is told when the broker comes and goes."""

    def __init__(
        self,
        access: Access,
        prefix: str,
        clock: Callable[[], float],
        told: Callable[[bool, str], None],
        connect: Connect | None = None,
    ) -> None:
        self._roster, self._prefix, self._tell = Roster(prefix, clock), prefix, told
        self._commands = [Topics(prefix, "+").of("+", "command"), Topics(prefix, "+").everyone]
        subscriptions = [*self._roster.subscriptions, *self._commands]
        self._link = BrokerLink(access, subscriptions, self._hear, self._told, connect=connect, flood=FLOOD)
        self._token = secrets.token_urlsafe(24)
        own = {path.name: path for path in OWN.iterdir()}
        self._files = Pages(own | {name: PAGE / name for name in SHARED})
        self._there, self._why = False, "the broker has not answered yet"
        self._passed_on: dict[str, asyncio.Event] = {}
        self._runner: web.AppRunner | None = None
        self.where = ""

    async def open(self, port: int) -> None:
        """Listen on this computer. Raises OSError."""
        app = web.Application(middlewares=[guarded(self._refused)], client_max_size=1024)
        app.add_routes([
            web.get("/", self._index), web.get("/fleet.json", self._mounts), web.post("/stop", self._stop),
            web.get("/{path:.+}", self._files.file),
        ])  # fmt: skip
        self._runner = await runner_of(app)
        try:
            taken = await listen(self._runner, "127.0.0.1", port)
        except OSError:
            await self._runner.cleanup()
            raise
        self.where = f"http://127.0.0.1:{taken}/"
        self._link.start()

    async def close(self) -> None:
        """Nobody is shown anything any more."""
        if self._runner is not None:
            await self._runner.cleanup()
        await self._link.close()

    # --- the broker -------------------------------------------------------------------------------------------------

    def _told(self, there: bool, why: str) -> None:
        self._there, self._why = there, why
        self._tell(there, why)

    def _hear(self, heard: Heard) -> None:
        if heard.topic in self._passed_on and not heard.retained:
            self._passed_on[heard.topic].set()
        else:
            self._roster.hear(heard)

    async def send_stop(self, stop: Stop) -> str:
        """Tell one mount, or all -> why it was not sent; nothing where it was."""
        topics = Topics(self._prefix, stop.gateway)
        topic = topics.of(stop.mount, "command") if stop.mount else topics.everyone
        if not self._there:
            return f"the broker is not there ({self._why})"
        heard = self._passed_on.setdefault(topic, asyncio.Event())
        self._link.publish(Message(topic, b"stop"))
        try:
            async with asyncio.timeout(PASSED_ON):
                await heard.wait()
        except TimeoutError:
            return "the broker has not passed it on"
        finally:
            if self._passed_on.get(topic) is heard:
                del self._passed_on[topic]
        return ""

    # --- the gate ---------------------------------------------------------------------------------------------------

    def _refused(self, request: web.Request) -> str:
        """Why a request is not served: it comes from elsewhere, or lacks the token for what only the page may have."""
        headers = request.headers
        ours = known_host(headers.get("Host"), "127.0.0.1") and of_the_page(headers, request.path)
        private = request.path in ("/fleet.json", "/stop")
        if ours and (not private or same_token(headers.get("X-Token"), self._token)):
            return ""
        return "Only the page of this overview may ask for this."

    # --- what is served ---------------------------------------------------------------------------------------------

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return self._files.index(token=self._token)

    async def _mounts(self, request: web.Request) -> web.StreamResponse:
        told = {"there": self._there, "why": self._why, "mounts": self._roster.mounts()}
        return web.Response(body=msgspec.json.encode(told), content_type="application/json")

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        try:
            stop = msgspec.json.decode(await request.read(), type=Stop)
        except ValueError:
            raise web.HTTPBadRequest(reason="This names no mount.") from None
        if bool(stop.gateway) != bool(stop.mount) or set(stop.gateway + stop.mount) & set("/+#\0"):
            raise web.HTTPBadRequest(reason="This names no mount.")
        why = await self.send_stop(stop)
        told = {"sent": not why, "words": UNSENT.format(why=why) if why else "stop sent"}
        return web.Response(body=msgspec.json.encode(told), content_type="application/json")
