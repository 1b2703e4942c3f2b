"""The files of a state folder: what a real hand control would keep when it is switched off, what moves, what is held.

A file is always complete, because it is written beside the old one, flushed to the disk, and renamed. A file that
cannot be read is moved aside and never prevents a start. Nothing here waits or uses an event loop; ``store.py`` decides
when to write.
"""

from __future__ import annotations

import contextlib
import os
import re
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta, Struct

from gateway.core.operations import Values
from gateway.mount.safety.sync_sum import SyncSum
from gateway.protocols.base.session import UNNAMED, MountSettings, NamedSite
from gateway.system.files import flush_folder

FORMAT: Final = 1
#: Longest name of a mount's files: with an ending it must fit a directory entry.
LONGEST = 120

Byte = Annotated[int, Meta(ge=0, le=255)]
#: Names of values of the two motors in what clients have in common.
MOTORS = ("backlash ", "guide rate ")
#: The file that holds the mounts of its folder for as long as it exists: nothing moves them.
HOLD = "hold"
_HELD = b"mount-gateway stop --hold: no mount of this folder is moved until mount-gateway stop --release.\n"


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


# --- the hold ---------------------------------------------------------------------------------------------------


def is_held(folder: Path) -> bool:
    """Whether the mounts of a state folder are held. An empty file, whoever owns it, holds as well as any other."""
    return os.path.lexists(folder / HOLD)


def hold_folder(folder: Path) -> None:
    """Hold them, over a power cut too as far as the disk allows. Raises OSError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    number = os.open(folder / HOLD, os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    with contextlib.suppress(OSError):  # a full disk: the name is enough
        os.write(number, _HELD)
        os.fsync(number)
    os.close(number)
    with contextlib.suppress(OSError):
        flush_folder(folder)


def release_folder(folder: Path) -> bool:
    """Hold them no longer -> whether they were held. Raises OSError."""
    try:
        os.unlink(folder / HOLD)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


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
