"""Finds telescopes of Alpaca servers, for ``detect``: by ASCOM's discovery in every network of this computer, or at
addresses that are given. Servers are only asked what they offer: no telescope is connected, and nothing moves.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from gateway.protocols.alpaca.http.chain import SERVER_NAME
from gateway.protocols.alpaca.http.discovery import DISCOVERY_PORT, DISCOVERY_REQUEST, HostAndPort
from gateway.protocols.base.spec import OfferedMount
from gateway.system.own_names import ipv4_networks
from gateway.transport.listening import url_host

if TYPE_CHECKING:
    from aiohttp import ClientSession

#: How many times the discovery request is sent, and the seconds between; seconds to wait for answers after the last
#: time; seconds in which a server must answer an HTTP request.
DISCOVERY_ATTEMPTS, DISCOVERY_PERIOD, DISCOVERY_WAIT, SERVER_TIMEOUT = 3, 0.15, 1.0, 5.0
#: The port of a server whose address contains none.
DEFAULT_HTTP_PORT = 80


async def find(urls: Sequence[str] | None, port: int = DISCOVERY_PORT) -> list[OfferedMount]:
    """Return the telescopes of these servers, or (None) of all that answer discovery on UDP ``port``; each once."""
    if urls is not None and not urls:
        return []
    from aiohttp import ClientSession, ClientTimeout

    places = await _discover(port) if urls is None else [_host_and_port(url) for url in urls]
    async with ClientSession(timeout=ClientTimeout(total=SERVER_TIMEOUT)) as session:
        answers = await asyncio.gather(*(_read_telescopes(session, *place) for place in places))
    mounts: dict[str, OfferedMount] = {}
    for mount in sorted((telescope for several in answers for telescope in several), key=_local_first_key):
        mounts.setdefault(mount.unique_id.casefold() or mount.url, mount)
    return list(mounts.values())


def _local_first_key(mount: OfferedMount) -> tuple[bool, str]:
    """Sort key: loopback addresses come first, because they do not change with the network."""
    host = urlsplit(mount.url).hostname or ""
    return not (host in ("localhost", "::1") or host.startswith("127.")), mount.url


def _host_and_port(url: str) -> HostAndPort:
    parts = urlsplit(url)
    return parts.hostname or "", parts.port or DEFAULT_HTTP_PORT


# --- asking the network ---------------------------------------------------------------------------------------------


class _DiscoveryClient(asyncio.DatagramProtocol):
    def __init__(self, addresses: set[HostAndPort]) -> None:
        self._addresses = addresses

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        with contextlib.suppress(ValueError, TypeError, KeyError):
            if 0 < (port := int(json.loads(data)["AlpacaPort"])) < 65536:
                self._addresses.add((addr[0], port))


async def _discover(port: int) -> list[HostAndPort]:
    """Return the servers that answer a broadcast in each network of this computer, loopback included, except link-local
    networks and prefixes longer than /30. A broadcast to 255.255.255.255 would reach one network only.
    """
    places: set[HostAndPort] = set()
    loop, askers = asyncio.get_running_loop(), []
    for address, network in ipv4_networks():
        if network.is_link_local or network.prefixlen > 30:
            continue
        with contextlib.suppress(OSError):
            made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            made.bind((str(address), 0))
            transport, _ = await loop.create_datagram_endpoint(lambda: _DiscoveryClient(places), sock=made)
            askers.append((transport, str(network.broadcast_address)))
    for _ in range(DISCOVERY_ATTEMPTS):
        for transport, broadcast in askers:
            transport.sendto(DISCOVERY_REQUEST, (broadcast, port))
        await asyncio.sleep(DISCOVERY_PERIOD)
    await asyncio.sleep(DISCOVERY_WAIT)
    for transport, _ in askers:
        transport.close()
    return sorted(places)


# --- asking a server ------------------------------------------------------------------------------------------------


async def _read_telescopes(session: ClientSession, host: str, port: int) -> list[OfferedMount]:
    """Return the telescopes of a server; none if it does not answer as ASCOM defines."""
    server, now = f"http://{url_host(host)}:{port}", asyncio.get_running_loop().time
    began = now()
    devices = await _read_value(session, f"{server}/management/v1/configureddevices")
    seconds = now() - began
    about = await _read_value(session, f"{server}/management/v1/description")
    about = about if isinstance(about, dict) else {}
    name = " ".join(str(about.get(key) or "") for key in ("ServerName", "ManufacturerVersion")).strip()
    return [
        OfferedMount(
            url=f"{server}/{device.get('DeviceNumber', 0)}",
            product=str(device.get("DeviceName") or "telescope"),
            server_name=name or "a server without a name",
            is_gateway=about.get("ServerName") == SERVER_NAME,
            unique_id=str(device.get("UniqueID") or ""),
            seconds=seconds,
        )
        for device in (devices if isinstance(devices, list) else [])
        if isinstance(device, dict) and str(device.get("DeviceType")).lower() == "telescope"
    ]


async def _read_value(session: ClientSession, url: str) -> Any:
    """Request a URL and return the value in the server's answer; None if there is no valid answer."""
    from aiohttp import ClientError

    try:
        async with session.get(url) as answer:
            return json.loads(await answer.text())["Value"]
    except (ClientError, OSError, ValueError, TypeError, KeyError, TimeoutError):
        return None
