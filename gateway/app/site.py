"""The web application of a gateway, served at every HTTP port: its mounts for programs, and the page if any."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from gateway.clients.access import AccessRules
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.system import garbage
from gateway.transport.listening import split_address
from gateway.transport.web_server import NO_PAGE_RESPONSE

if TYPE_CHECKING:
    from aiohttp import web

    from gateway.app.gateway import Gateway

#: Imports the modules of the page, on a thread; returns the function that adds the page to an application.
LoadPage = Callable[[], Callable[["web.Application"], object]]


async def load_web_application(
    gateways: Sequence[Gateway], host_names: Iterable[str] = (), load_page: LoadPage | None = None
) -> web.Application:
    """Return the application, once the ports of the gateways are open.

    ``host_names`` are further host names by which clients may call this computer, besides those of the surfaces.
    """
    for gateway in gateways:
        await gateway.ports_ready.wait()
    # loading takes a quarter of a second, and clients must not wait
    add_page = await asyncio.to_thread(_load_web_server, gateways, load_page)
    from gateway.app.pages import make_app

    every = [*host_names, *(name for gateway in gateways for surface in gateway.surfaces for name in surface.names)]
    app = make_app(every, [gateway.wire_log for gateway in gateways], _rules_by_port(gateways))
    for name, spec in PROTOCOLS.items():
        devices = [device for gateway in gateways for protocol, device in gateway.web_devices() if protocol == name]
        if spec.web is not None and devices:
            spec.web().add_routes(app, devices)
    await asyncio.sleep(0)  # each half takes milliseconds, and clients come between them
    add_page(app)
    garbage.exclude_present_objects()  # again, for the objects of the web server
    return app


def _rules_by_port(gateways: Sequence[Gateway]) -> dict[int, AccessRules]:
    """Return the ports of surfaces that speak HTTP, and the access rules of each."""
    return {
        split_address(port.address)[1]: acceptor.access
        for gateway in gateways
        for endpoint, port, acceptor in zip(gateway.endpoints, gateway.ports, gateway.acceptors, strict=True)
        if "://" in port.address and (endpoint.protocol == ANY or PROTOCOLS[endpoint.protocol].web is not None)
    }


def _load_web_server(gateways: Sequence[Gateway], load_page: LoadPage | None) -> Callable[[web.Application], object]:
    """Load the web server and the page, on a thread that yields to the event loop five times as often as usual."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(usual / 5.0)
    try:
        for spec in PROTOCOLS.values():
            if spec.web is not None:
                spec.web().load_modules()
        for acceptor in [offered for gateway in gateways for offered in gateway.acceptors]:
            getattr(acceptor, "binding", None)  # makes what is presented to programs that speak HTTP
        return _add_not_found if load_page is None else load_page()
    finally:
        sys.setswitchinterval(usual)


def _add_not_found(app: web.Application) -> None:
    from aiohttp import web

    async def answer_not_found(request: web.Request) -> web.StreamResponse:
        return web.Response(status=404, text=NO_PAGE_RESPONSE[1], headers={"Connection": "close"})

    app.add_routes([web.get("/{path:.*}", answer_not_found)])
