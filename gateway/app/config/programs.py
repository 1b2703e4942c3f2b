"""The settings that particular programs need on a surface, from ``mappings/*/clients.toml``.

``client = "NAME"`` on a surface fills in the settings that the user left open. Without it, a program is recognised if
the first bytes of its connection are unmistakable; then only that connection gets these settings.
"""

from functools import lru_cache

import msgspec

from gateway.app.config.endpoints import Endpoint, parse_endpoint
from gateway.app.config.keys import SurfaceConfig
from gateway.clients.commands.unread import HOLD_TIME
from gateway.core.errors import MappingError
from gateway.protocols.registry import ANY, PROTOCOLS
from gateway.protocols.wireformat.command_set import load
from gateway.protocols.wireformat.rows import Version, parse_version
from gateway.transport.listening import NETWORK_SCHEMES

#: Stands in comparisons for an unknown version, and for StarSense hand controls, whose versions start again from 1.
NEWEST_VERSION = (99,)


class NeededSetting(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A value that a program needs for a key of the surface, and why."""

    key: str
    value: str
    why: str
    #: The need exists only with hand controls before this version, and with a GT, whose versions begin at 100.
    below: str | None = None


class KnownProgram(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A program that connects to surfaces, and how it differs from others."""

    name: str
    needs: list[NeededSetting] = []
    #: First bytes that only this program sends, and how that is known.
    first: str | None = None
    evidence: str = ""
    #: Whether the program leaves the text of a refusal unread.
    leaves_text: bool = False
    #: Whether it sends a stop of all motion when its user releases an arrow.
    stops_arrows: bool = False


@lru_cache
def programs(protocol: str) -> dict[str, KnownProgram]:
    """Return the known programs that speak a protocol, by key. Raises MappingError."""
    rows = {}
    for key, row in load(protocol).extra_table("clients.toml").items():
        try:
            rows[key] = msgspec.convert(row, KnownProgram)
        except msgspec.ValidationError as error:
            raise MappingError(f"mappings/{protocol}/clients.toml", key, str(error)) from None
    return rows


def unmet_needs(surface: SurfaceConfig, program: str | None = None) -> list[NeededSetting]:
    """Return the settings that a program (default: ``client``) needs and neither the surface nor its model sets."""
    endpoint, name = parse_endpoint(surface.at), program or surface.client
    row = None if ANY in (endpoint.protocol, name) or name == "auto" else programs(endpoint.protocol).get(name)
    if row is None:
        return []
    numbers = _presented_version(endpoint)
    decided = load(endpoint.protocol).models.get(endpoint.model or "", {})
    return [
        need
        for need in row.needs
        if getattr(surface, need.key.replace("-", "_")) is None
        and need.key not in decided
        and (need.below is None or numbers < parse_version(need.below) or numbers[0] >= 100)
    ]


def _presented_version(endpoint: Endpoint) -> Version:
    """Return the version that the surface reports to programs; ``NEWEST_VERSION`` for none and for ``starsense``."""
    spec = PROTOCOLS[endpoint.protocol]
    version = endpoint.version or spec.presented_version
    if version is None or version.partition("-")[0] in spec.version_aliases:
        return NEWEST_VERSION
    return parse_version(version)


def with_needs(surface: SurfaceConfig, program: str | None = None) -> SurfaceConfig:
    """Return the surface with the unmet needs of a program (default: ``client``) filled in."""
    return msgspec.structs.replace(surface, **as_fields(unmet_needs(surface, program)))


def as_fields(needs: list[NeededSetting]) -> dict[str, object]:
    """Return the values of needed settings by their field names in ``SurfaceConfig``."""
    return {need.key.replace("-", "_"): need.value for need in needs}


def text_delay(surface: SurfaceConfig, protocol: str, program: str) -> float:
    """Return for how many seconds the text of a refusal is held back: infinite if the program never reads it."""
    if not surface.hold_text:
        return 0.0
    row = programs(protocol).get(program)
    return HOLD_TIME if row is None else float("inf") if row.leaves_text else 0.0


def stops_all(protocol: str, program: str) -> bool:
    """Whether a program sends a stop of all motion when its user releases an arrow."""
    row = programs(protocol).get(program)
    return row is not None and row.stops_arrows


def first_bytes(surface: SurfaceConfig) -> dict[bytes, str]:
    """Return the programs that a surface must treat unlike others, by the first bytes that each sends.

    The result is empty on a serial line, which another program may take over unnoticed, and if ``client`` is not auto.
    """
    endpoint = parse_endpoint(surface.at)
    if surface.client != "auto" or not endpoint.where.startswith(NETWORK_SCHEMES):
        return {}
    return {
        row.first.encode("latin-1"): key
        for key, row in programs(endpoint.protocol).items()
        if row.first is not None and (row.leaves_text or row.stops_arrows or unmet_needs(surface, key))
    }
