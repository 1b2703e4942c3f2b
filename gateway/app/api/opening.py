"""How a program gets a ``Mount``: it opens a gateway in its own process, or connects to a gateway that already runs.

``open_gateway`` does what ``mount-gateway run`` does for one mount: it opens the mount's port and the surfaces, starts
the watchdog process for a real mount, and stops the mount at the end. Everything runs on the caller's event loop,
except that a process of its own calculates the tables of the sky. ``connect`` finds a gateway as ``mount-gateway goto``
does.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from typing import TYPE_CHECKING

from gateway.app.api.mount import Mount
from gateway.app.config import Source, make_config, parse_endpoint
from gateway.app.control.exchange import ControlEndpoint
from gateway.app.control.reach import ANSWER_TIMEOUT, running_gateways, send_request
from gateway.app.watchdog.client import Watchdog, is_available
from gateway.astro.ephemeris.keeper import AlmanacKeeper
from gateway.astro.ephemeris.sky import Sky
from gateway.core import requests
from gateway.core.errors import UserError
from gateway.core.wire_log import Entry, WireLog
from gateway.transport.web_server import WebServer

if TYPE_CHECKING:
    from gateway.app.gateway import Gateway

#: Keys that only ``mount-gateway run`` honours -> what a Python program uses instead.
RUN_ONLY_KEYS = {
    "wait": "ready(seconds) waits for the mount",
    "record": "mount-gateway run --record FILE records; watch is called with every command and reply",
    "record_keep": "mount-gateway run --record FILE records; watch is called with every command and reply",
}


@contextlib.asynccontextmanager
async def open_gateway(
    mount: str,
    surfaces: str | Sequence[str | Mapping[str, object]] = (),
    *,
    warn: Callable[[str], None] | None = None,
    watch: Callable[[Entry], None] | None = None,
    watchdog: bool = True,
    **settings: object,
) -> AsyncIterator[Mount]:
    """Open a mount (``"nexstar@/dev/ttyUSB0"``, ``"nexstar@sim"``) and the surfaces on which programs reach it, if any.

    ``settings`` are the keys of ``[mount]`` in docs/configuration.md with ``_`` for ``-``: ``site=(48.1, 11.6)``,
    ``lowest=15``. A surface is an endpoint such as ``"lx200@tcp://127.0.0.1:4030"`` (port 0: any free port), or a
    mapping of the keys of ``[[surface]]``. ``warn`` is called with whole sentences for the user, and ``watch`` with
    every entry of the wire log. Both are called on the event loop and must return quickly. Raises UserError for an
    invalid setting, a mount in use, and a surface that cannot be opened; use ``Mount.ready`` to wait for the mount.
    Leaving the block stops the mount and closes everything. ``watchdog``: start a watchdog process for a real mount.
    """
    for name in settings.keys() & RUN_ONLY_KEYS:
        raise UserError(f"open_gateway: {name} is not a setting of this function: {RUN_ONLY_KEYS[name]}.")
    tables: dict[str, object] = {
        "mount": [_to_config_keys({"at": mount, **settings})],
        "surface": [
            _to_config_keys(surface if isinstance(surface, Mapping) else {"at": surface})
            for surface in ([surfaces] if isinstance(surfaces, str) else surfaces)
        ],
    }
    config = make_config(tables, Source("open_gateway"), needs_surface=False)
    from gateway.app.gateway import Gateway
    from gateway.app.site import load_web_application

    sky, wire_log = Sky(), WireLog(time.time)
    if watch is not None:
        wire_log.sinks.append(watch)
    real = parse_endpoint(mount).where != "sim"
    guard = Watchdog(warn or (lambda text: None)) if watchdog and real and is_available() else None
    opened = Gateway(config.mount[0], config.surface, wire_log, sky, warn=warn, watchdog=guard)
    opened.web = WebServer(lambda: load_web_application([opened]))

    almanac = AlmanacKeeper(sky, opened.warn, all_at_rest=lambda: not opened.moving)
    almanac.open()
    keeping: asyncio.Task[None] | None = None
    try:
        await opened.open()
        if guard is not None:
            guard.start()
        for caution in opened.start_warnings():
            opened.warn(caution)
        keeping = asyncio.ensure_future(almanac.run())
        yield mount_in_process(opened)
    finally:
        if keeping is not None:
            keeping.cancel()
        await opened.close()
        if guard is not None:
            guard.close()


def mount_in_process(gateway: Gateway) -> Mount:
    """Return the mount of a gateway in this process."""

    async def send(req: requests.Request, _: float) -> requests.Answer:
        return await gateway.carry_out(req)

    return Mount(gateway.config.name or str(gateway.mount), send, "the program that embeds the gateway")


def connect(mount: str | None = None, *, state: str | None = None) -> Mount:
    """Find a gateway on this computer, in a service or another program, and return its mount.

    ``mount`` is the mount's name, endpoint or port, needed if several gateways run. ``state`` is the gateway's state
    folder, if it is not the default one. Nothing stays open between two requests, and a motion continues after the
    program that requested it has ended. Raises UserError if no gateway runs, or if several do.
    """
    gateways = running_gateways(mount, state)
    if not gateways:
        raise UserError(f"no gateway runs here{f' for {mount}' if mount else ''}; mount-gateway run starts one")
    if len(gateways) > 1:
        names = ", ".join(sorted(endpoint.title for endpoint in gateways))
        raise UserError(f"{len(gateways)} mounts run on this computer; choose one: {names}")
    return mount_at_endpoint(gateways[0])


def mount_at_endpoint(endpoint: ControlEndpoint) -> Mount:
    """Return the mount of the gateway that has this control endpoint."""

    async def send(req: requests.Request, duration: float) -> requests.Answer:
        return await send_request(endpoint, req, ANSWER_TIMEOUT + duration)

    return Mount(endpoint.title, send, f"a Python program (process {os.getpid()})")


def _to_config_keys(settings: Mapping[str, object]) -> dict[str, object]:
    """Return keyword arguments under the key names of ``gateway.toml``."""
    return {name.replace("_", "-"): value for name, value in settings.items()}
