"""What single programs need of a surface, by ``mappings/*/clients.toml``.

``client = "NAME"`` on a surface fills in what its user left open. Without it a program is recognised where the first
bytes of its connection tell it unmistakably; then only that connection is treated so.
"""

from __future__ import annotations

from functools import lru_cache

import msgspec

from gateway.app.config.endpoints import Endpoint, parse_endpoint
from gateway.app.config.keys import SurfaceConfig
from gateway.core.errors import MappingError
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Version, parse_version
from gateway.transport.listening import LISTENING

#: A hand control that programs take for the newest there is, whatever its number: it counts anew.
NEWEST = (99,)


class Need(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One key of the surface and why the program needs it; ``below``: only with hand controls before that version."""

    key: str
    value: str
    why: str
    below: str | None = None


class Program(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One program. ``first`` are the bytes that only it begins a connection with, ``told`` why that is so."""

    name: str
    needs: list[Need] = []
    first: str | None = None
    told: str = ""


@lru_cache
def programs(protocol: str) -> dict[str, Program]:
    """The programs that are known to speak a protocol. Raises MappingError."""
    rows = {}
    for key, row in load(protocol).extra("clients.toml").items():
        try:
            rows[key] = msgspec.convert(row, Program)
        except msgspec.ValidationError as error:
            raise MappingError(f"mappings/{protocol}/clients.toml", key, str(error)) from None
    return rows


def wanted_by(surface: SurfaceConfig, program: str | None = None) -> list[Need]:
    """What a program (the surface's own ``client`` when none is named) needs that the surface leaves open."""
    endpoint = parse_endpoint(surface.at)
    row = None if endpoint.protocol == ANY else programs(endpoint.protocol).get(program or surface.client)
    if row is None:
        return []
    numbers = _numbers(endpoint)
    return [
        need
        for need in row.needs
        if getattr(surface, need.key.replace("-", "_")) is None
        and (need.below is None or numbers < parse_version(need.below) or numbers[0] >= 100)
    ]


def _numbers(endpoint: Endpoint) -> Version:
    """The version that programs go by: of one that is named by a word, which counts anew, the newest."""
    spec = PROTOCOLS[endpoint.protocol]
    version = endpoint.version or spec.presented_version
    if version is None or version.partition("-")[0] in spec.version_words:
        return NEWEST
    return parse_version(version)


def settled(surface: SurfaceConfig, program: str | None = None) -> SurfaceConfig:
    """The surface with what the program needs filled in."""
    return msgspec.structs.replace(surface, **as_settings(wanted_by(surface, program)))


def as_settings(needs: list[Need]) -> dict[str, object]:
    """Needs by the name of the field that they fill."""
    return {need.key.replace("-", "_"): need.value for need in needs}


def recognisable(surface: SurfaceConfig) -> dict[bytes, str]:
    """First bytes -> program, for those that would get something other than everybody on this surface.

    Only where connections always begin and end, which is the network: on a serial line one program may follow another
    unnoticed.
    """
    endpoint = parse_endpoint(surface.at)
    if surface.client != "auto" or not endpoint.where.startswith(LISTENING):
        return {}
    return {
        row.first.encode("latin-1"): key
        for key, row in programs(endpoint.protocol).items()
        if row.first is not None and wanted_by(surface, key)
    }
