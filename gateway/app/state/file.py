"""The state file of a mount: what a real hand control would keep when it is switched off.

A file is always complete, because it is written beside the old one, flushed to the disk, and renamed. A file that
cannot be read is moved aside and never prevents a start. Nothing here waits or uses an event loop; ``store.py`` decides
when to write.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta, Struct

from gateway.core.operations import Values
from gateway.mount.safety.rules.sync_sum import SyncSum
from gateway.protocols.base.session import UNNAMED, MountSettings, NamedSite

FORMAT: Final = 1
#: Longest name of a mount's files: with an ending it must fit a directory entry.
LONGEST = 120

Byte = Annotated[int, Meta(ge=0, le=255)]
#: Names of values of the two motors in what clients have in common.
MOTORS = ("backlash ", "guide rate ")


class SavedState(Struct, omit_defaults=True):
    """A state file. ``mount`` is the driver's own: where home is, whether the mount is parked."""

    format: Literal[1]
    sites: dict[Annotated[str, Meta(pattern="^[0-3]$")], NamedSite] = {}
    site: Annotated[int, Meta(ge=0, le=3)] | None = None
    #: Time zone in hours and daylight saving, as a hand control's client has set them.
    zone: tuple[Annotated[float, Meta(ge=-14, le=14)], Annotated[int, Meta(ge=0, le=1)]] | None = None
    pec: bool | None = None
    motors: dict[str, Byte] = {}
    mount: Values = {}
    #: How far the syncs since the mount's alignment have moved the sky together.
    synced: SyncSum = SyncSum()


class MarkerContent(Struct):
    """A motion marker: the mount that moves, how to reach it, and what its driver must know to stop it."""

    mount: str
    baud: int
    memory: Values = {}


def file_name(protocol: str, where: str) -> str:
    """What a mount's files are called, without ending: ``nexstar@dev_ttyUSB0``."""
    return f"{protocol}@{re.sub(r'[^A-Za-z0-9.-]+', '_', where).strip('_.')}"[:LONGEST]


# --- writing and reading ----------------------------------------------------------------------------------------


def encode(kept: SavedState) -> bytes:
    """As it stands in the file, for people to read."""
    return msgspec.json.format(msgspec.json.encode(kept, order="sorted"), indent=2) + b"\n"


def read_kept(path: Path) -> SavedState:
    """An absent file is an empty state. Raises OSError, and ValueError for a file that is not one of these."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=SavedState)
    except FileNotFoundError:
        return SavedState(FORMAT)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(str(error)) from None


def read_mark(path: Path) -> MarkerContent | None:
    """A marker that cannot be read is a marker all the same: its mount is then not known. None where there is none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=MarkerContent)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError):  # the library's errors are ValueErrors
        return MarkerContent("", 9600)


def move_aside(path: Path) -> Path:
    """Out of the way, for a person to look at. Raises OSError."""
    bad = path.with_name(f"{path.name}.bad")
    path.replace(bad)
    return bad


# --- between the file and what clients have in common -----------------------------------------------------------


def to_shared(kept: SavedState) -> MountSettings:
    """What all clients of a mount begin with."""
    return MountSettings(
        sites={int(index): site for index, site in kept.sites.items()},
        site=kept.site,
        zone=kept.zone,
        pec=kept.pec,
        motors={name: value for name, value in kept.motors.items() if name.startswith(MOTORS)},
    )


def from_shared(shared: MountSettings, mount: Values, synced: SyncSum = SyncSum()) -> SavedState:
    """The lasting part of it; the rest (a pulse under way, a drive rate) ends with the gateway."""
    return SavedState(
        FORMAT,
        sites={str(index): site for index, site in shared.sites.items() if site != UNNAMED},
        site=shared.site,
        zone=shared.zone,
        pec=shared.pec,
        motors=dict(shared.motors),
        mount=mount,
        synced=synced,
    )
