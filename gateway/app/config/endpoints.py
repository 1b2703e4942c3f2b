"""Parses endpoints, names of mounts, brokers and sites as users type them, and suggests corrections.

A name such as ``6se``, ``CPC 1100`` or ``lx90`` stands for protocol and model; ``called.toml`` of each protocol lists
the names. ``celestron`` stands for a protocol without a model. An endpoint is
``PROTOCOL[:MODEL[/VERSION]]@WHERE``; a broker ``mqtt://HOST:PORT``, or ``mqtts://`` with TLS; a site ``LAT,LON``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import urlsplit

import msgspec

from gateway.core.errors import UserError, similar_words
from gateway.protocols.base.spec import ProtocolSpec
from gateway.protocols.registry import ANY, PROTOCOLS, drivers, streams, surfaces
from gateway.protocols.wireformat.command_set import load

#: The row of ``called.toml`` whose names stand for a protocol without a model.
ANY_MODEL = "any"


def resolve_name(text: str) -> str | None:
    """Return ``PROTOCOL[:MODEL]`` for a mount's name, None if unknown. A model after ``PROTOCOL:`` may be unknown."""
    head, colon, rest = text.partition(":")
    if not colon:
        return head if head in PROTOCOLS else _look_up(_name_table(), head)
    protocol = head if head in PROTOCOLS else _look_up(_name_table(), head)
    if protocol not in PROTOCOLS:
        return None
    if not rest or rest in load(protocol).models:
        return f"{protocol}:{rest}" if rest else protocol
    of_protocol = {
        word: protocol_name for word, protocol_name in _name_table().items() if protocol_name.startswith(f"{protocol}:")
    }
    return _look_up(of_protocol, rest) or f"{protocol}:{rest}"


def suggest_name(word: str, candidates: Sequence[str] = tuple(PROTOCOLS)) -> str:
    """Return a hint for an unknown word: the most similar name or candidate protocol, else each maker's protocol."""
    known = [*candidates, *(model for protocol in PROTOCOLS for model in load(protocol).models)]
    plain = _normalise(word)
    names = [name for name, full_name in sorted(_name_table().items()) if full_name.partition(":")[0] in candidates]
    for choices in (known, names):
        if close := similar_words(plain if choices is not known else word, choices, min_similarity=0.7):
            return f"did you mean {close[0]!r}?"
    which = ", ".join(
        f"{name} for a {spec.makers[0].title()}" for name, spec in reversed(PROTOCOLS.items()) if spec.makers
    )
    return f"write {which}, or the name of the mount: 6se, cpc, avx, lx90, etx (mount-gateway --help lists the models)"


@cache
def _name_table() -> Mapping[str, str]:
    """Return every name, without blanks and punctuation, with the ``PROTOCOL[:MODEL]`` it stands for."""
    rows = {_normalise(model): f"{protocol}:{model}" for protocol in PROTOCOLS for model in load(protocol).models}
    for protocol in PROTOCOLS:
        for model, names in names_by_model(protocol).items():
            rows |= dict.fromkeys(names, protocol if model == ANY_MODEL else f"{protocol}:{model}")
    return rows | {protocol: protocol for protocol in PROTOCOLS}


def names_by_model(protocol: str) -> dict[str, Sequence[str]]:
    """Return the names that users write for each model of a protocol. Raises MappingError for a bad ``called.toml``."""
    return {model: row["words"] for model, row in load(protocol).extra_table("called.toml").items()}


def _look_up(table: Mapping[str, str], text: str) -> str | None:
    plain = _normalise(text)
    return table.get(plain) or table.get(_maker_pattern().sub("", plain))


@cache
def _maker_pattern() -> re.Pattern[str]:
    """Return the pattern of a maker or brand that may stand before the name of a mount."""
    specs = PROTOCOLS.values()
    makers = "|".join(maker for spec in specs for maker in spec.makers)
    brands = "|".join(brand for spec in specs for brand in spec.brands)
    return re.compile(f"^(?:{makers})?(?:{brands})?(?=.)")


def _normalise(word: str) -> str:
    return re.sub("[^a-z0-9]", "", word.lower())


_ADDRESS = re.compile(r"(?:(tcp|socket|rfc2217):/?)?([\w.-]+|\[[\w:]+\]):(\d{1,5})")
#: The address of a mount that is reached over HTTP, with its device number if it is not the server's first mount.
HTTP_ADDRESS = re.compile(r"http://(?:[\w.-]+|\[[\w:]+\]):\d{1,5}(?:/\d{0,10})?")
#: The default ports of brokers, by scheme.
BROKER_PORTS = {"mqtt": 1883, "mqtts": 8883}
BROKER_URL_ADVICE = "write mqtt://HOST:PORT, or mqtts://HOST:PORT with TLS"


class Endpoint(msgspec.Struct, frozen=True):
    """A mount or a surface: a protocol, optionally a model and a version, and a port, address or path (``where``)."""

    protocol: str
    where: str
    model: str | None = None
    version: str | None = None

    def __str__(self) -> str:
        return f"{device_text(self.protocol, self.model, self.version)}@{self.where}"


def device_text(protocol: str, model: str | None = None, version: str | None = None) -> str:
    """Return the part of an endpoint before its ``@``."""
    return protocol if protocol == ANY else PROTOCOLS[protocol].endpoint_text(model, version)


def parse_endpoint(text: str, role: str = "") -> Endpoint:
    """Parse an endpoint; ``role`` is ``mount`` or ``surface``, or empty if it may be either. Raises UserError."""
    what, at, where = text.partition("@")
    if not at or not where:
        raise UserError(
            f"{text!r}: write PROTOCOL[:MODEL[/VERSION]]@WHERE, for example {_example_endpoint(text.strip('@'), role)}"
        )
    endpoint = _parse_any_surface(what, where) if what.partition(":")[0] == ANY else parse_device(what, where, role)
    if role == "mount" and endpoint.protocol not in (*drivers(), ANY):
        raise UserError(f"{endpoint}: {endpoint.protocol} mounts cannot be driven; {' or '.join(drivers())} can")
    return _check_http_address(endpoint, role) if where.startswith("http") or role == "mount" else endpoint


def _check_http_address(endpoint: Endpoint, role: str) -> Endpoint:
    """Return the endpoint. Raises UserError if an HTTP address is needed and missing, or present and useless."""
    where, over = endpoint.where, [name for name, spec in PROTOCOLS.items() if spec.make_http_dialect is not None]
    meant = "HOST:PORT" if (match := _ADDRESS.fullmatch(where)) is None else f"{match[2]}:{match[3]}"
    if where.startswith("http") and (endpoint.protocol not in over or role == "surface"):
        raise UserError(f"{endpoint}: only a mount is reached over HTTP; write {over[0]}@http://HOST:PORT")
    if endpoint.protocol in over and where != "sim" and not HTTP_ADDRESS.fullmatch(where):
        raise UserError(
            f"{endpoint}: such a mount is reached over HTTP; write {endpoint.protocol}@http://{meant}, "
            f"or http://{meant}/1 for the second mount of its server"
        )
    return endpoint


def _parse_any_surface(text: str, where: str) -> Endpoint:
    """Parse ``any@…``, a surface for every protocol. Raises UserError if it has a model or no ``tcp://`` address."""
    if text != ANY:
        raise UserError(f"{text!r}: a surface for every protocol presents no single model; write {ANY}@{where}")
    if not where.startswith("tcp://"):
        allowed = " or ".join(f"{name}@" for name in streams())
        mount = " or ".join(f"{name}@" for name in drivers())
        raise UserError(
            f"{ANY}@{where}: {ANY} recognises programs by the first bytes of a connection, and needs tcp://; "
            f"write {ANY}@{suggest_address(where, True) or 'tcp://HOST:PORT'}, "
            f"or one protocol: {allowed} where programs connect, {mount} for a mount"
        )
    return Endpoint(ANY, where)


def _example_endpoint(text: str, role: str) -> str:
    """Return an example endpoint that completes ``text``, the half that the user wrote."""
    if role == "surface":
        return f"{_serial_names()[0]}@tcp://127.0.0.1:4030"
    if resolve_name(text.partition("/")[0]):
        return f"{text}@/dev/ttyUSB0"
    if text.startswith(("/dev/", "COM", "tcp://", "socket://", "rfc2217://", "pty:")) or text == "sim":
        return " or ".join(f"{name}@{text} ({PROTOCOLS[name].makers[0].title()})" for name in reversed(_serial_names()))
    return f"{_serial_names()[-1]}@/dev/ttyUSB0"


def _serial_names() -> list[str]:
    """Return the protocols of mounts on serial lines."""
    return [name for name in drivers() if PROTOCOLS[name].make_http_dialect is None]


def parse_device(text: str, where: str = "", role: str = "") -> Endpoint:
    """Parse ``PROTOCOL[:MODEL[/VERSION]]``, or an owner's name for a mount in place of protocol or model.

    The error names the protocols for ``role``, ``mount`` or ``surface``. A StarSense hand control may be written as a
    version or as a model. Raises UserError for a protocol, model or version that does not exist.
    """
    name, slash, version = text.partition("/")
    device = resolve_name(name)
    if device is None:
        among = {"mount": drivers(), "surface": [*surfaces(), ANY]}.get(role, list(PROTOCOLS))
        raise UserError(f"{name!r} is neither a protocol ({', '.join(among)}) nor a model; {suggest_name(name, among)}")
    protocol, _, model = device.partition(":")
    spec = PROTOCOLS[protocol]
    if model in spec.version_aliases:
        model, version = "", spec.version_aliases[model](version if slash else None)
    possible = [*spec.commands.models, *spec.version_aliases] if model or version else []
    if (model or version) and not possible:
        raise UserError(f"{text!r}: {protocol} has neither models nor versions; write {protocol}@{where or 'WHERE'}")
    if model and model not in possible:
        other = resolve_name(model)
        right = f"write {other}" if other else suggest_choice(model, possible)
        raise UserError(f"{protocol} has no model {model!r}; {right}")
    return Endpoint(protocol, where, model or None, _normalise_version(spec, version) if version else None)


def _normalise_version(spec: ProtocolSpec, text: str) -> str:
    """Return the version in its standard form. Raises UserError for malformed text, or a version known not to exist."""
    try:
        return spec.normalise_version(text)
    except ValueError:
        raise UserError(f"{text!r} is not a version; write it like 4.21") from None


def suggest_address(where: str, is_surface: bool, devices: Path = Path("/dev")) -> str:
    """Return the probable correction of an address of a surface (``is_surface``) or a mount; empty if it may be right.

    It recognises a missing scheme, a surface's scheme on a mount or the reverse, and a port without its folder.
    """
    scheme, slashes, rest = where.partition("://")
    if slashes:
        wrong, good = ("socket", "tcp") if is_surface else ("tcp", "socket")
        return f"{good}://{rest}" if scheme == wrong else ""
    if match := _ADDRESS.fullmatch(where):
        right_scheme = match[1] if match[1] == "rfc2217" else "tcp" if is_surface else "socket"
        return f"{right_scheme}://{match[2]}:{match[3]}"
    if is_surface and re.fullmatch(r":?\d{1,5}", where):
        return f"tcp://127.0.0.1:{where.lstrip(':')}"
    if is_surface and where in ("pty", "pty:"):
        return "pty:/tmp/telescope"
    if not is_surface and where.startswith("pty:"):
        return where.removeprefix("pty:")
    if re.fullmatch(r"[\w.-]+", where) and not os.path.exists(where) and (devices / where).exists():
        return str(devices / where)
    return ""


def suggest_choice(word: str, choices: Sequence[str]) -> str:
    """Return a hint for a mistyped word: the choice that is most like it, else all choices."""
    close = similar_words(word, choices) or [
        choice for choice in choices if len(choice) > 3 and word.startswith(choice)
    ]
    return f"did you mean {close[0]!r}?" if close else f"write one of {', '.join(choices)}"


def parse_site(text: str) -> tuple[float, float]:
    """Parse ``LAT,LON`` in degrees, north and east positive, or as on maps: ``48°08'N,11°36'E``. Raises UserError."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) == 2 and parts[0][-1:].upper() in ("E", "W") and parts[1][-1:].upper() in ("N", "S"):
        parts.reverse()
    try:
        latitude, longitude = (float(part) for part in parts)
    except ValueError:
        latitude, longitude = _parse_map_coordinates(text, parts)
    if wrong := site_mistake(latitude, longitude):
        raise UserError(f"{text!r}: {wrong}")
    return latitude, longitude


#: A latitude or longitude as on maps: degrees, perhaps minutes and seconds, and N, S, E or W.
_MAP_COORDINATE = re.compile(
    r"""([+-]?)(\d+(?:\.\d+)?)\s*[°d:]?\s*(?:(?<=[°d:\s])(\d+(?:\.\d+)?)\s*['′m:]?\s*)?"""
    r"""(?:(?<=['′m:\s])(\d+(?:\.\d+)?)(?:s|\s*["″])?\s*)?([NSEW]?)"""
)


def _parse_map_coordinates(text: str, parts: Sequence[str]) -> tuple[float, float]:
    """Parse a latitude and a longitude with minutes, or with N, S, E or W. Raises UserError."""
    values = [_parse_angle(part, sides) for part, sides in zip(parts, ("NS", "EW"), strict=False)]
    if len(parts) != 2 or None in values or abs(values[0] or 0.0) > 90.0:
        raise UserError(f"{text!r}: write LAT,LON, north and east positive: 45.5,-122.7 or 45°30'N,122°42'W")
    return values[0] or 0.0, values[1] or 0.0


def _parse_angle(text: str, sign_letters: str) -> float | None:
    """Parse an angle as on maps; return degrees, None if invalid. ``sign_letters``: for + and -, like ``NS``."""
    match = _MAP_COORDINATE.fullmatch(text)
    if match is None or match[5] not in ("", *sign_letters) or (match[1] == "-" and match[5]):
        return None
    degrees, minutes, seconds = (float(match[number] or 0.0) for number in (2, 3, 4))
    if max(minutes, seconds) >= 60.0:
        return None
    value = degrees + minutes / 60.0 + seconds / 3600.0
    return -value if match[1] == "-" or match[5] == sign_letters[1] else value


def site_mistake(latitude: float, longitude: float) -> str:
    """Return what is wrong with a latitude and a longitude in degrees; empty if nothing is."""
    if -90 <= latitude <= 90 and -180 <= longitude <= 360:
        return ""
    message = "latitude is -90 to 90, longitude -180 to 180 (east positive)"
    if -90 <= longitude <= 90 and -180 <= latitude <= 360:
        message += f"; the latitude comes first: {longitude:g},{latitude:g}?"
    return message


class Broker(msgspec.Struct, frozen=True):
    """The address of a broker. ``user`` is empty if the address names none."""

    host: str
    port: int
    tls: bool
    user: str = ""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"mqtt{'s' * self.tls}://{host}:{self.port}"


def parse_broker(text: str) -> Broker:
    """Parse the address of a broker. It may contain a user's name but no password, because all users can see flags.

    Raises UserError with the correct form; its text does not repeat a password.
    """
    try:
        parts = urlsplit(text)
        host, port, password = parts.hostname, parts.port, parts.password
    except ValueError:
        raise UserError(f"not a broker's address: {BROKER_URL_ADVICE}") from None
    if password is not None:
        raise UserError(
            "the address contains a password that others could see: put it into a file (password-file) or into the "
            "environment variable MOUNT_GATEWAY_MQTT_PASSWORD"
        )
    if parts.scheme not in BROKER_PORTS or not host or parts.path.strip("/") or parts.query or parts.fragment:
        raise UserError(f"{text!r}: {BROKER_URL_ADVICE}")
    return Broker(host, port or BROKER_PORTS[parts.scheme], parts.scheme == "mqtts", parts.username or "")
