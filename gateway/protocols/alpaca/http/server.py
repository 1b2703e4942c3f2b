"""The web server: its addresses, the check of requests, and the answers to invalid ones.

Alpaca has no passwords, and web pages in a browser can send requests here too. Therefore requests from web pages are
refused (``Origin``, ``Sec-Fetch-Site``), and those addressed to another computer (``Host``). Importing this module
imports aiohttp, which is slow: import it when the first client connects.
"""

from __future__ import annotations

import asyncio
import html
import socket
import uuid
from collections.abc import Awaitable, Callable, Sequence
from urllib.parse import parse_qsl

from aiohttp import web

from gateway.core.about import full_version, version
from gateway.core.errors import ReadOnly
from gateway.protocols.alpaca.http.chain import MEMBER, SERVER, tokens
from gateway.protocols.alpaca.http.programs import Device, numbered
from gateway.protocols.alpaca.http.requests import BadRequest, Pairs, client_numbers, parse_request
from gateway.protocols.alpaca.tables import empty_value, member, refused
from gateway.transport.handler import ConnectionRefused
from gateway.transport.http_server import OTHER_NAME, HttpServer, addressed_here, turned_away
from gateway.transport.web_port import WebDevice

#: The longest body of a request, bytes.
LONGEST = 8192
FORM = "application/x-www-form-urlencoded"
CONSOLE = '<a href="/">The console</a> shows and moves the mount.'
NO_CONSOLE = (
    "Its console shows and moves the mount; its address is in the line <q>ready console</q> that the gateway prints."
)
NOT_HERE = (
    "This gateway does not know the name or address in the Host header. If that leads here, through a container or a "
    'router, add it: names = ["pier.example.org"] on the surface, or --names pier.example.org.'
)
#: The UUID namespace of the devices' identifiers.
_SPACE = uuid.UUID("6f3d2c1e-7c1b-5d0e-9a53-6d6f756e7467")
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class AlpacaServer:
    """The devices of one port. ``names`` are additional host names of this computer; requests that pass ``may_act`` may
    do more than read and stop; ``console``: the same port has the console's page.
    """

    def __init__(
        self,
        devices: Sequence[WebDevice],
        names: Sequence[str] = (),
        may_act: Callable[[web.Request], bool] = lambda request: True,
        console: bool = False,
    ) -> None:
        self._devices, self._names = [Device(device) for device in devices], tuple(names)
        self._may_act, self._console = may_act, console

    def add_to(self, app: web.Application) -> None:
        """Add the routes that ASCOM defines."""
        serve = self._guarded
        app.add_routes([
            web.get("/management/{about:apiversions|v1/description|v1/configureddevices}", serve(self._management)),
            web.get("/setup", serve(self._setup)),
            web.get("/setup/v1/{kind}/{number}/setup", serve(self._setup)),
            web.route("*", "/api/v1/{kind}/{number}/{member}", serve(self._member)),
            web.route("*", "/{tail:(?:api|management)(?:/.*)?}", serve(self._unknown)),
        ])  # fmt: skip

    def close(self) -> None:
        """Close the connections of all programs."""
        for device in self._devices:
            device.programs.close()

    # --- the check of requests --------------------------------------------------------------------------------------

    def _guarded(self, handler: Handler) -> Handler:
        async def guarded(request: web.Request) -> web.StreamResponse:
            if words := self._refused(request):
                return web.Response(status=403, text=f"{words}\n")
            try:
                return await handler(request)
            except BadRequest as error:
                headers = {"Allow": error.allow} if error.allow else None
                return web.Response(status=405 if error.allow else 400, text=f"{error}\n", headers=headers)
            except ConnectionRefused:
                return web.Response(status=403, text="This computer may not use this mount, or too many do.\n")

        return guarded

    def _refused(self, request: web.Request) -> str:
        """Return why a request is refused, or an empty string."""
        if not addressed_here(request, self._names):
            turned_away(request, OTHER_NAME, [device.web.log for device in self._devices])
            return NOT_HERE
        if "Origin" in request.headers or request.headers.get("Sec-Fetch-Site", "none") != "none":
            return "Requests from web pages are refused."
        return ""

    # --- the device -------------------------------------------------------------------------------------------------

    async def _member(self, request: web.Request) -> web.StreamResponse:
        device = self._device(request)
        pairs = await _parameters(request)
        asked = parse_request(request.method, request.match_info["member"], pairs)
        harmless = request.method == "GET" or member(asked.command.name).always
        if harmless or self._may_act(request):
            reply = await device.answer(asked, request.remote or "?")
        else:
            reply = refused(ReadOnly())
        if request.method == "GET":
            reply = {**empty_value(asked.command), **reply}
        return web.json_response(numbered(reply, asked.transaction))

    def _device(self, request: web.Request) -> Device:
        """Return the device of the address. Raises BadRequest."""
        kind, number = request.match_info["kind"], request.match_info["number"]
        if kind != "telescope":
            raise BadRequest(f"There is no device of type {kind!r} here; the only type is telescope")
        if not (number.isascii() and number.isdecimal() and len(number) < 11 and int(number) < len(self._devices)):
            raise BadRequest(f"There is no telescope {number!r} here; the numbers are 0 to {len(self._devices) - 1}")
        return self._devices[int(number)]

    async def _unknown(self, request: web.Request) -> web.StreamResponse:
        raise BadRequest("There is nothing at this address: use /api/v1/telescope/0/ and a member in lower case")

    # --- management -------------------------------------------------------------------------------------------------

    async def _management(self, request: web.Request) -> web.StreamResponse:
        server = {
            "ServerName": SERVER, "Manufacturer": "the mount-gateway developers",
            "ManufacturerVersion": version(), "Location": "", MEMBER: tokens(),
        }  # fmt: skip
        devices = [
            {"DeviceName": device.web.title, "DeviceType": "Telescope", "DeviceNumber": number,
             "UniqueID": _unique_id(device.web.title)}
            for number, device in enumerate(self._devices)
        ]  # fmt: skip
        told = {"apiversions": [1], "v1/description": server, "v1/configureddevices": devices}
        _, transaction = client_numbers(list(request.query.items()), any_case=True)
        value = told[request.match_info["about"]]
        return web.json_response(numbered({"Value": value, "ErrorNumber": 0, "ErrorMessage": ""}, transaction))

    async def _setup(self, request: web.Request) -> web.StreamResponse:
        if "kind" in request.match_info:
            self._device(request)
        rows = "".join(
            f"<li>telescope {number}: {html.escape(device.web.title)}" for number, device in enumerate(self._devices)
        )
        page = (
            '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n<title>mount-gateway</title>\n'
            f"<h1>mount-gateway {full_version()}</h1>\n"
            f"<p>by the mount-gateway developers. Its telescopes:\n<ul>{rows}</ul>\n"
            f"<p>{CONSOLE if self._console else NO_CONSOLE}\n"
            "<p>It is configured by its command line or its configuration file.\n"
        )
        return web.Response(text=page, content_type="text/html")


class OwnServer:
    """The web server of a port that has only Alpaca."""

    def __init__(self, server: HttpServer, alpaca: AlpacaServer) -> None:
        self._server, self._alpaca = server, alpaca

    @classmethod
    async def start(cls, alpaca: AlpacaServer) -> OwnServer:
        app = web.Application(client_max_size=LONGEST)
        alpaca.add_to(app)
        return cls(await HttpServer.start(app), alpaca)

    def __call__(self) -> asyncio.Protocol:
        return self._server()

    async def close(self) -> None:
        """Stop answering and close all connections."""
        self._alpaca.close()
        await self._server.close()


def _unique_id(title: str) -> str:
    """Return an identifier that stays the same while the mount is at the same endpoint of the same computer."""
    return str(uuid.uuid5(_SPACE, f"{socket.gethostname()} {title}"))


async def _parameters(request: web.Request) -> Pairs:
    """Return the parameters of the query, or of the body of a PUT. Raises BadRequest."""
    if request.method != "PUT":
        return list(request.query.items())
    if request.content_type not in (FORM, "application/octet-stream"):
        raise BadRequest(f"The parameters of a PUT must be in its body as {FORM}")
    try:
        body = (await _body(request)).decode("utf-8")
        return parse_qsl(body, keep_blank_values=True, max_num_fields=100, errors="strict")
    except ValueError:
        raise BadRequest("The parameters cannot be decoded") from None


async def _body(request: web.Request) -> bytes:
    """Return the whole body, which may arrive in pieces; half a number would be another number. Raises BadRequest."""
    body = b""
    async for piece in request.content.iter_any():
        body += piece
        if len(body) > LONGEST:
            raise BadRequest(f"The body is longer than {LONGEST} bytes")
    return body
