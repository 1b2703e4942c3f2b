"""Alpaca's part of the web server: its routes, the check of requests, and the answers to invalid requests.

Alpaca has no passwords, and web pages in a browser can send requests to this server, too. Therefore requests from web
pages are refused (``Origin``, ``Sec-Fetch-Site``). Importing this module imports aiohttp, which is slow: import it when
the first client connects.
"""

from __future__ import annotations

import html
import socket
import uuid
from collections.abc import Sequence
from email import message_from_bytes
from typing import Any
from urllib.parse import parse_qsl

from aiohttp import web

from gateway.core.about import full_version, version
from gateway.core.errors import ReadOnly
from gateway.protocols.alpaca.http.chain import SERVER_NAME, TOKENS_MEMBER, tokens
from gateway.protocols.alpaca.http.programs import AlpacaDevice, with_ids
from gateway.protocols.alpaca.http.requests import BadRequest, ParameterPairs, parse_request, parse_request_ids
from gateway.protocols.alpaca.tables import conditions_of, empty_value, error_members
from gateway.transport.handler import ConnectionRefused
from gateway.transport.http_requests import READ_ONLY_KEY, Handler, local_address
from gateway.transport.web_server import WebDevice

#: The UUID namespace of the devices' identifiers, which depend on the computer's name and the mount's title.
_UUID_NAMESPACE = uuid.UUID("6f3d2c1e-7c1b-5d0e-9a53-6d6f756e7467")


class AlpacaServer:
    """Serves the requests for Alpaca devices."""

    def __init__(self, devices: Sequence[WebDevice]) -> None:
        self._all_devices = [AlpacaDevice(device) for device in devices]

    def add_to(self, app: web.Application) -> None:
        """Add the routes that ASCOM defines."""
        serve = self._checked_handler
        app.add_routes([
            web.get("/management/{about:apiversions|v1/description|v1/configureddevices}", serve(self._serve_devices)),
            web.get("/setup", serve(self._serve_setup)),
            web.get("/setup/v1/{kind}/{number}/setup", serve(self._serve_setup)),
            web.route("*", "/api/v1/{kind}/{number}/{member}", serve(self._serve_member)),
            web.route("*", "/{tail:(?:api|management)(?:/.*)?}", serve(self._refuse_unknown)),
        ])  # fmt: skip
        app.on_shutdown.append(self._close)

    async def _close(self, app: web.Application) -> None:
        """Close the connections of all programs."""
        for device in self._all_devices:
            device.programs.close()

    # --- the check of requests --------------------------------------------------------------------------------------

    def _checked_handler(self, handler: Handler) -> Handler:
        async def guarded(request: web.Request) -> web.StreamResponse:
            if "Origin" in request.headers or request.headers.get("Sec-Fetch-Site", "none") != "none":
                return web.Response(status=403, text="Requests from web pages are refused.\n")
            try:
                return await handler(request)
            except BadRequest as error:
                headers = {"Allow": error.allowed_methods} if error.allowed_methods else None
                return web.Response(status=405 if error.allowed_methods else 400, text=f"{error}\n", headers=headers)
            except ConnectionRefused:
                return web.Response(status=403, text="This computer may not use this mount, or too many do.\n")

        return guarded

    # --- the device -------------------------------------------------------------------------------------------------

    async def _serve_member(self, request: web.Request) -> web.StreamResponse:
        device = self._requested_device(request)
        pairs = await _read_parameters(request)
        asked = parse_request(request.method, request.match_info["member"], pairs)
        harmless = request.method == "GET" or conditions_of(asked.command.name).always
        if harmless or not request.app[READ_ONLY_KEY](request):
            reply = await device.answer(asked, request.remote or "?")
        else:
            reply = error_members(ReadOnly())
        if request.method == "GET":
            reply = {**empty_value(asked.command), **reply}
        return web.json_response(with_ids(reply, asked.transaction_id))

    def _devices_at_port(self, request: web.Request) -> list[AlpacaDevice]:
        """Return the devices that are configured for the port of a request, else those without a port of their own."""
        port = local_address(request)[1]
        offered = [device for device in self._all_devices if device.web_mount.port == port]
        return offered or [device for device in self._all_devices if not device.web_mount.port]

    def _requested_device(self, request: web.Request) -> AlpacaDevice:
        """Return the device that the path of a request names. Raises BadRequest if there is none."""
        devices = self._devices_at_port(request)
        kind, number = request.match_info["kind"], request.match_info["number"]
        if kind != "telescope":
            raise BadRequest(f"There is no device of type {kind!r} here; the only type is telescope")
        if not (number.isascii() and number.isdecimal() and len(number) < 11 and int(number) < len(devices)):
            raise BadRequest(f"There is no telescope {number!r} here; the numbers are 0 to {len(devices) - 1}")
        return devices[int(number)]

    async def _refuse_unknown(self, request: web.Request) -> web.StreamResponse:
        raise BadRequest("There is nothing at this address: use /api/v1/telescope/0/ and a member in lower case")

    # --- management -------------------------------------------------------------------------------------------------

    async def _serve_devices(self, request: web.Request) -> web.StreamResponse:
        server = {
            "ServerName": SERVER_NAME, "Manufacturer": "the mount-gateway developers",
            "ManufacturerVersion": version(), "Location": "", TOKENS_MEMBER: tokens(),
        }  # fmt: skip
        devices = [
            {"DeviceName": device.web_mount.title, "DeviceType": "Telescope", "DeviceNumber": number,
             "UniqueID": str(uuid.uuid5(_UUID_NAMESPACE, f"{socket.gethostname()} {device.web_mount.title}"))}
            for number, device in enumerate(self._devices_at_port(request))
        ]  # fmt: skip
        values = {"apiversions": [1], "v1/description": server, "v1/configureddevices": devices}
        _, transaction = parse_request_ids(list(request.query.items()), any_case=True)
        value = values[request.match_info["about"]]
        return web.json_response(with_ids({"Value": value, "ErrorNumber": 0, "ErrorMessage": ""}, transaction))

    async def _serve_setup(self, request: web.Request) -> web.StreamResponse:
        if "kind" in request.match_info:
            self._requested_device(request)
        rows = "".join(
            f"<li>telescope {number}: {html.escape(device.web_mount.title)}"
            for number, device in enumerate(self._devices_at_port(request))
        )
        page = (
            '<!doctype html>\n<html lang="en">\n<meta charset="utf-8">\n<title>mount-gateway</title>\n'
            f"<h1>mount-gateway {full_version()}</h1>\n"
            f"<p>by the mount-gateway developers. Its telescopes:\n<ul>{rows}</ul>\n"
            '<p><a href="/">The console</a> shows and moves the mount, unless it was started without one.\n'
            "<p>It is configured by its command line or its configuration file.\n"
        )
        return web.Response(text=page, content_type="text/html")


async def _read_parameters(request: web.Request) -> ParameterPairs:
    """Return the parameters of the query, or of the body of a PUT. Raises BadRequest if they cannot be decoded."""
    if request.method != "PUT":
        return list(request.query.items())
    body = await request.read()
    try:
        if body.startswith(b"--"):
            pairs = _parse_form_data(body)
        else:
            pairs = parse_qsl(body.decode("utf-8"), keep_blank_values=True, max_num_fields=100, errors="strict")
        return [(name, value.strip()) for name, value in pairs]  # a + that is not encoded is a blank
    except ValueError:
        raise BadRequest("The parameters cannot be decoded") from None


def _parse_form_data(body: bytes) -> ParameterPairs:
    """Return the parameters of a multipart/form-data body. Raises ValueError if it is incomplete."""
    boundary = body.partition(b"\n")[0].strip().removeprefix(b"--")
    form: Any = message_from_bytes(b'Content-Type: multipart/form-data; boundary="%s"\r\n\r\n' % boundary + body)
    if form.defects or not form.is_multipart():
        raise ValueError("the form is incomplete")
    return [
        (str(part.get_param("name", "", "content-disposition")), part.get_payload(decode=True).decode("utf-8"))
        for part in form.get_payload()
    ]
