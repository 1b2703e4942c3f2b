"""The web server of the page that shows all mounts on a broker, and that can stop them.

As in the console, a request must name this computer as its host, come from the page itself, and contain the page's
token. This server receives its own stop from the broker, too; only then does it report that the stop was sent.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from aiohttp import web
from msgspec import Struct

from gateway.app.pages import Pages, is_same_token, make_app, require_own_page
from gateway.fleet.client import BrokerAccess, Connect
from gateway.fleet.link import BrokerLink
from gateway.fleet.topics import ONLINE, MqttMessage, ReceivedMessage, Topics
from gateway.transport.web_server import WebServer

#: The ID of a gateway, and the name of one of its mounts.
_MountKey = tuple[str, str]
#: Maximum number of mounts that are shown; maximum length of a text that is shown, in characters.
MAX_MOUNTS, MAX_TEXT_LENGTH = 5000, 200
#: Kinds of events that report the result of an order.
RESULT_KINDS = ("done", "failed", "refused")


class ShownState(Struct, frozen=True):
    """The values of a mount's published state that the page shows."""

    online: bool = False
    does: str = ""  # activity in words
    ra_hours: float | None = None
    dec_degrees: float | None = None
    altitude_degrees: float | None = None
    azimuth_degrees: float | None = None
    moving: bool = False
    held: bool = False  # no client may move it
    model: str | None = None
    programs: int = 0  # connected
    time: float = 0.0  # Unix seconds


class ShownEvent(Struct, frozen=True):
    """The values of a published event that the page shows."""

    kind: str
    who: str = ""  # the client, or the mount
    words: str = ""  # the message


class MountList:
    """The mounts on a broker: newest states, connected gateways, results of orders. ``clock`` returns Unix seconds.
    Anyone may publish on a broker: a message that does not have the expected form is ignored.
    """

    def __init__(self, prefix: str, clock: Callable[[], float]) -> None:
        self._topics, self._clock = Topics(prefix, "+"), clock
        self._is_online: dict[str, bool] = {}
        self._states: dict[_MountKey, tuple[ShownState, float]] = {}
        self._results: dict[_MountKey, tuple[ShownEvent, float]] = {}

    @property
    def subscriptions(self) -> list[str]:
        """The topics to subscribe to."""
        topics = self._topics
        return [topics.availability, topics.of("+", "state"), topics.of("+", "event")]

    def receive(self, received: ReceivedMessage) -> None:
        """Store a message from the broker, if it has an expected topic and form."""
        match self._topics.levels_of(received.topic):
            case [gateway, "availability"] if gateway in self._is_online or len(self._is_online) < MAX_MOUNTS:
                self._is_online[gateway] = received.payload == ONLINE
            case [gateway, mount, "state"]:
                self._store(self._states, (gateway, mount), received, ShownState)
            case [gateway, mount, "event"] if not received.retained:
                self._store(self._results, (gateway, mount), received, ShownEvent)

    def _store(
        self, table: dict[_MountKey, tuple[Any, float]], key: _MountKey, received: ReceivedMessage, value_type: Any
    ) -> None:
        if not received.payload:
            table.pop(key, None)  # an empty payload deletes a retained message
            return
        try:
            value = msgspec.json.decode(received.payload, type=value_type)
        except (ValueError, RecursionError):
            return
        if isinstance(value, ShownEvent) and (value.kind not in RESULT_KINDS or value.who != "mqtt"):
            return
        if key in table or len(table) < MAX_MOUNTS:
            then = value.time if received.retained and isinstance(value, ShownState) else self._clock()
            table[key] = value, then

    def mounts(self) -> list[dict[str, Any]]:
        """Return the mounts as the page shows them, sorted by name. ``age`` is that of the state, in seconds."""
        now, mounts = self._clock(), []
        for (gateway, mount), (state, then) in sorted(self._states.items()):
            event, result_time = self._results.get((gateway, mount), (None, 0.0))
            mounts.append({
                "gateway": gateway[:MAX_TEXT_LENGTH], "mount": mount[:MAX_TEXT_LENGTH],
                "available": self._is_online.get(gateway, False), "online": state.online,
                "does": state.does[:MAX_TEXT_LENGTH], "moving": state.moving, "held": state.held,
                "ra": state.ra_hours, "dec": state.dec_degrees, "alt": state.altitude_degrees,
                "az": state.azimuth_degrees, "model": (state.model or "")[:MAX_TEXT_LENGTH], "programs": state.programs,
                "age": round(max(0.0, now - then)), "said": event.words[:MAX_TEXT_LENGTH] if event else "",
                "said_age": round(max(0.0, now - result_time)) if event else 0,
            })  # fmt: skip
        return mounts


PAGE_FOLDER = Path(__file__).parent / "page"
#: Files of the console's page that this server serves as well.
CONSOLE_FILES = ("css/tokens.css", "css/base.css", "css/forced.css", "js/first.js", "js/core/dom.js",
                 "js/core/format.js", "icon.svg")  # fmt: skip
#: Timeout in seconds for the broker to send a stop back to this server; the most messages a second that are accepted.
ECHO_TIMEOUT, MAX_MESSAGE_RATE = 3.0, 5000
#: The message if a stop was not passed on.
STOP_FAILED = "STOP WAS NOT SENT: {why}. Use mount-gateway stop at the mount's computer, its keys, or its power switch."


class StopForm(Struct, frozen=True, forbid_unknown_fields=True):
    """A request of the page to stop a mount, or all mounts if both fields are empty."""

    gateway: str = ""
    mount: str = ""


class OverviewServer:
    """Serves the page until ``close``. ``on_connection`` is called when the broker is connected or lost.
    ``style_folder``: the folder of the console's page, whose style this page shares.
    """

    def __init__(
        self,
        access: BrokerAccess,
        prefix: str,
        style_folder: Path,
        clock: Callable[[], float],
        on_connection: Callable[[bool, str], None],
        connect: Connect | None = None,
    ) -> None:
        self._mount_list, self._prefix, self._notify_connection = MountList(prefix, clock), prefix, on_connection
        self._command_topics = [Topics(prefix, "+").of("+", "command"), Topics(prefix, "+").all_mounts]
        subscriptions = [*self._mount_list.subscriptions, *self._command_topics]
        self._link = BrokerLink(
            access, subscriptions, self._on_message, self._on_connection, connect=connect, max_rate=MAX_MESSAGE_RATE
        )
        self._token = secrets.token_urlsafe(24)
        files = {path.name: path for path in PAGE_FOLDER.iterdir()}
        self._files = Pages(files | {name: style_folder / name for name in CONSOLE_FILES})
        self._is_connected, self._disconnect_reason = False, "the broker has not answered yet"
        self._waiting_for_echo: dict[str, asyncio.Event] = {}
        self._server = WebServer(self._make_application)
        self.address = ""

    async def open(self, port: int) -> None:
        """Listen on a port of this computer only, and begin to connect to the broker. Raises UserError."""
        self.address = (await self._server.listen(f"tcp://127.0.0.1:{port}")).address.replace("tcp", "http") + "/"
        self._link.start()

    async def _make_application(self) -> web.Application:
        app = make_app()
        app.add_routes([
            web.get("/", require_own_page(self._index)),
            web.get("/fleet.json", require_own_page(self._mounts, self._refusal_reason)),
            web.post("/stop", require_own_page(self._stop, self._refusal_reason)),
            web.get("/{path:.+}", require_own_page(self._files.serve_file)),
        ])  # fmt: skip
        return app

    async def close(self) -> None:
        """Stop serving, and disconnect from the broker."""
        await self._server.close()
        await self._link.close()

    # --- the broker -------------------------------------------------------------------------------------------------

    def _on_connection(self, connected: bool, reason: str) -> None:
        self._is_connected, self._disconnect_reason = connected, reason
        self._notify_connection(connected, reason)

    def _on_message(self, message: ReceivedMessage) -> None:
        if message.topic in self._waiting_for_echo and not message.retained:
            self._waiting_for_echo[message.topic].set()
        else:
            self._mount_list.receive(message)

    async def send_stop(self, stop: StopForm) -> str:
        """Send a stop to one mount or all; return why it was not sent, or an empty text."""
        topics = Topics(self._prefix, stop.gateway)
        topic = topics.of(stop.mount, "command") if stop.mount else topics.all_mounts
        if not self._is_connected:
            return f"the broker cannot be reached ({self._disconnect_reason})"
        heard = self._waiting_for_echo.setdefault(topic, asyncio.Event())
        self._link.publish(MqttMessage(topic, b"stop"))
        try:
            async with asyncio.timeout(ECHO_TIMEOUT):
                await heard.wait()
        except TimeoutError:
            return "the broker has not passed it on"
        finally:
            if self._waiting_for_echo.get(topic) is heard:
                del self._waiting_for_echo[topic]
        return ""

    # --- what is served ---------------------------------------------------------------------------------------------

    def _refusal_reason(self, request: web.Request) -> str:
        """Return why a request is refused; an empty text if it has the token of the page."""
        known = is_same_token(request.headers.get("X-Token"), self._token)
        return "" if known else "Only the page of this overview may ask for this."

    async def _index(self, request: web.Request) -> web.StreamResponse:
        return await self._files.serve_page(request, token=self._token)

    async def _mounts(self, request: web.Request) -> web.StreamResponse:
        state = {"there": self._is_connected, "why": self._disconnect_reason, "mounts": self._mount_list.mounts()}
        return web.Response(body=msgspec.json.encode(state), content_type="application/json")

    async def _stop(self, request: web.Request) -> web.StreamResponse:
        try:
            stop = msgspec.json.decode(await request.read(), type=StopForm)
        except ValueError:
            raise web.HTTPBadRequest(reason="This names no mount.") from None
        if bool(stop.gateway) != bool(stop.mount) or set(stop.gateway + stop.mount) & set("/+#\0"):
            raise web.HTTPBadRequest(reason="This names no mount.")
        why = await self.send_stop(stop)
        answer = {"sent": not why, "words": STOP_FAILED.format(why=why) if why else "stop sent"}
        return web.Response(body=msgspec.json.encode(answer), content_type="application/json")
