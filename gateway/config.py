"""What a user sets: on the command line or in ``gateway.toml``, under the same names.

An endpoint is ``PROTOCOL[:MODEL[/VERSION]]@WHERE``. Every mistake is one line that says where it is and what would be
right.
"""

from __future__ import annotations

import difflib
import re
from pathlib import Path
from typing import Any

import msgspec
import tomli

from gateway.errors import UserError
from gateway.tables import load, parse_version

PROTOCOLS = ("lx200", "nexstar")
OLDEST, NEWEST = (1, 2), (6, 0)


class Endpoint(msgspec.Struct, frozen=True):
    """One end of the gateway: a protocol, maybe a model and a version, and where it is."""

    protocol: str
    where: str
    model: str | None = None
    version: str | None = None

    def __str__(self) -> str:
        model = f":{self.model}" if self.model else ""
        return f"{self.protocol}{model}{'/' + self.version if self.version else ''}@{self.where}"


def parse_endpoint(text: str) -> Endpoint:
    """Raises UserError for an unknown protocol, model or version."""
    what, at, where = text.partition("@")
    if not at or not where:
        raise UserError(f"{text!r}: write PROTOCOL[:MODEL[/VERSION]]@WHERE, for example nexstar@/dev/ttyUSB0")
    return parse_device(what, where)


def parse_device(what: str, where: str = "") -> Endpoint:
    """``PROTOCOL[:MODEL[/VERSION]]``. Raises UserError."""
    protocol, _, rest = what.partition(":")
    if protocol not in PROTOCOLS:
        raise UserError(f"{protocol!r} is no protocol; write one of {', '.join(PROTOCOLS)}")
    model, _, version = rest.partition("/")
    if model and model not in load(protocol).models:
        raise UserError(f"{protocol} has no model {model!r}; {_nearest(model, list(load(protocol).models))}")
    if version and not version.startswith("starsense-"):
        try:
            parse_version(version)
        except ValueError:
            raise UserError(f"{version!r} is no version; write it like 4.21") from None
        known = OLDEST <= parse_version(version) < NEWEST or parse_version(version)[0] >= 100
        if protocol == "nexstar" and not known:
            raise UserError(f"{version!r}: hand controls have versions from 1.2 to 5.x, a GT from 100.0 on")
    return Endpoint(protocol, where, model or None, version or None)


def _nearest(word: str, choices: list[str]) -> str:
    close = difflib.get_close_matches(word, choices, 1)
    return f"did you mean {close[0]!r}?" if close else f"write one of {', '.join(choices)}"


def parse_site(text: str) -> tuple[float, float]:
    """``LAT,LON`` in degrees, north and east positive. Raises UserError."""
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError:
        raise UserError(f"{text!r} is no site; write LAT,LON, north and east positive: 45.5,-122.7") from None
    if not (-90 <= latitude <= 90 and -180 <= longitude <= 360):
        raise UserError(f"{text!r}: latitude is -90 to 90, longitude -180 to 180 (east positive)")
    return latitude, longitude


class MountConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """The ``[mount]`` table."""

    at: str
    baud: int = 9600
    site: tuple[float, float] | None = None
    mode: str | None = None
    equinox: str = "jnow"
    site_time: str = "unaligned"
    lowest: float = 0.0
    highest: float = 90.0
    sync_limit: float = 15.0
    guide_rate: float = 0.5
    park: tuple[float, float] | None = None
    aux_home: bool = False
    latency: float = 0.0
    speed: float = 1.0


class SurfaceConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """One ``[[surface]]`` table."""

    at: str
    equinox: str = "jnow"
    precision: str = "high"
    sync_text: str | None = None


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename="kebab"):
    """Everything ``run`` needs."""

    mount: MountConfig
    surface: list[SurfaceConfig]
    wait: bool = False
    log: bool = False


_CHOICES: dict[str, tuple[str, ...]] = {
    "equinox": ("jnow", "j2000", "auto"),
    "site-time": ("unaligned", "always", "never"),
    "precision": ("high", "low"),
    "mode": ("alt-az", "eq-north", "eq-south"),
}


def check(config: Config, where: str) -> Config:
    """Check what types cannot: choices and ranges. Raises UserError."""
    tables: list[tuple[str, MountConfig | SurfaceConfig]] = [("mount", config.mount)]
    tables += [("surface", surface) for surface in config.surface]
    for table, struct in tables:
        parse_endpoint(struct.at)
        for key, choices in _CHOICES.items():
            value = getattr(struct, key.replace("-", "_"), None)
            if value is not None and value not in choices:
                raise UserError(f"{where}: [{table}] {key} = {value!r}: write one of {', '.join(choices)}")
    mount = config.mount
    if not -90 <= mount.lowest < mount.highest <= 90:
        raise UserError(f"{where}: [mount] lowest must be below highest, both from -90 to 90 degrees")
    if mount.site is not None and not (-90 <= mount.site[0] <= 90 and -180 <= mount.site[1] <= 360):
        raise UserError(f"{where}: [mount] site is latitude, longitude in degrees, north and east positive")
    for key in ("baud", "speed", "sync_limit", "guide_rate"):
        if getattr(mount, key) <= 0:
            raise UserError(f"{where}: [mount] {key.replace('_', '-')} must be more than 0")
    if not config.surface:
        raise UserError(f"{where}: at least one surface is needed, for example lx200@tcp://127.0.0.1:4030")
    return config


def read_config(path: Path) -> Config:
    """Read ``gateway.toml``. Raises UserError with the file and the key."""
    try:
        tables = tomli.loads(path.read_text("utf-8"))
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from None
    except (tomli.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"{path}: {error}") from None
    return check(make_config(tables, str(path)), str(path))


def make_config(tables: dict[str, Any], where: str) -> Config:
    """Plain tables -> Config. Raises UserError that names the key."""
    try:
        return msgspec.convert(tables, Config)
    except msgspec.ValidationError as error:
        raise UserError(f"{where}: {_explain(str(error))}") from None


def _explain(message: str) -> str:
    """The library's message with the nearest right key, where one was mistyped."""
    found = re.search(r"unknown field `([^`]+)`(?: - at `\$\.?([^`]*)`)?", message)
    if not found:
        return message.replace("Object", "table").replace("`$.", "`").replace("`$`", "the file")
    key, at = found.group(1), found.group(2) or ""
    kind = MountConfig if at.startswith("mount") else SurfaceConfig if at.startswith("surface") else Config
    known = [field.encode_name for field in msgspec.structs.fields(kind)]
    table = f"[{at.split('[')[0]}] " if at else ""
    return f"{table}there is no key {key!r}; {_nearest(key, known)}"
