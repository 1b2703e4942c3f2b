"""The files of a state folder: the state that a real hand control keeps when off, motion markers, the hold file.

A file is always complete, because a new file is written beside the old file, flushed to the disk, and renamed. A file
that cannot be read is moved aside and never prevents a start. No event loop here; ``store.py`` decides when to write.
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
from gateway.mount.as_left import MountSnapshot
from gateway.mount.motion.left_moving import Leftover
from gateway.mount.safety.sync_sum import SyncSum
from gateway.mount.site.program_settings import SiteOfProgram
from gateway.protocols.base.session import UNNAMED_SITE, MountSettings, NamedSite
from gateway.system.files import flush_folder, open_regular_fd, open_regular_file

FORMAT_VERSION: Final = 1
#: Maximum length of the name of a mount's files: with an ending it must fit into a directory entry.
MAX_NAME_LENGTH = 120

Byte = Annotated[int, Meta(ge=0, le=255)]
#: The beginnings of the names of the two motors' settings, which all clients share.
MOTOR_SETTING_PREFIXES = ("backlash ", "guide rate ")
#: A gateway whose state folder contains this file at its start holds its mount: no program moves the mount.
HOLD_FILE = "hold"
_HOLD_TEXT = b"mount-gateway stop --hold: no mount of this folder is moved until mount-gateway stop --release.\n"


class SavedState(Struct, omit_defaults=True):
    """The content of a state file: the state that must survive the end of the gateway."""

    format: Literal[1]
    sites: dict[Annotated[str, Meta(pattern="^[0-3]$")], NamedSite] = {}
    site: Annotated[int, Meta(ge=0, le=3)] | None = None
    #: Time zone in hours and daylight saving, as a hand control's client has set them.
    zone: tuple[Annotated[float, Meta(ge=-14, le=14)], Annotated[int, Meta(ge=0, le=1)]] | None = None
    pec: bool | None = None
    motors: dict[str, Byte] = {}
    #: The driver's state: where home is, whether the mount is parked.
    mount: Values = {}
    #: The total offset by all syncs since the mount's alignment.
    synced: SyncSum = SyncSum()
    #: The mount as last seen. If it differs later, it was switched off meanwhile, and some stored values are wrong.
    left: MountSnapshot | None = None
    #: The site that a program has set last, if the mount reports none.
    site_of_program: SiteOfProgram | None = None


class MarkerContent(Struct):
    """The content of a motion marker: the endpoint of the moving mount, and what is needed to stop it."""

    mount: str
    baud: int
    #: The driver's state that a stop needs.
    memory: Values = {}
    #: Unix time at which the marker was written, by this computer's clock.
    at: float = 0.0
    motion: Leftover | None = None


def file_name(protocol: str, where: str) -> str:
    """Return the name of a mount's files without ending: ``nexstar@dev_ttyUSB0``."""
    return f"{protocol}@{re.sub(r'[^A-Za-z0-9.-]+', '_', where).strip('_.')}"[:MAX_NAME_LENGTH]


# --- writing and reading ----------------------------------------------------------------------------------------


def encode_state(state: SavedState) -> bytes:
    """Return the content of a state file: JSON that is indented for people to read."""
    return msgspec.json.format(msgspec.json.encode(state, order="sorted"), indent=2) + b"\n"


def _read_file(path: Path) -> bytes:
    with open_regular_file(path) as file:
        return file.read()


def read_state(path: Path) -> SavedState:
    """Read a state file; a missing file is an empty state. Raises OSError, and ValueError for an invalid file."""
    try:
        return msgspec.json.decode(_read_file(path), type=SavedState)
    except FileNotFoundError:
        return SavedState(FORMAT_VERSION)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ValueError(str(error)) from None


def read_marker(path: Path) -> MarkerContent | None:
    """Read a motion marker; None if there is none. An unreadable marker still counts, as that of an unknown mount."""
    try:
        return msgspec.json.decode(_read_file(path), type=MarkerContent)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError):  # the library's errors are ValueErrors
        return MarkerContent("", 9600)


def move_aside(path: Path) -> Path:
    """Rename an invalid file so that the user can look at it; return its new path. Raises OSError."""
    bad = path.with_name(f"{path.name}.bad")
    path.replace(bad)
    return bad


# --- the hold ---------------------------------------------------------------------------------------------------


def has_hold_file(folder: Path) -> bool:
    """Whether a state folder contains the hold file, whatever its content or owner: then its mounts must not move."""
    return os.path.lexists(folder / HOLD_FILE)


def write_hold_file(folder: Path) -> None:
    """Write the hold file of a state folder, flushed to the disk to survive a power failure. Raises OSError."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if has_hold_file(folder):
        return
    number = open_regular_fd(folder / HOLD_FILE, os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0))
    with contextlib.suppress(OSError):  # on a full disk an empty file is enough
        os.write(number, _HOLD_TEXT)
        os.fsync(number)
    os.close(number)
    with contextlib.suppress(OSError):
        flush_folder(folder)


def delete_hold_file(folder: Path) -> bool:
    """Delete the hold file of a state folder; return whether there was one. Raises OSError."""
    try:
        os.unlink(folder / HOLD_FILE)
    except (FileNotFoundError, NotADirectoryError):
        return False
    return True


# --- between the file and the settings that clients share -------------------------------------------------------


def to_settings(state: SavedState) -> MountSettings:
    """Return the shared settings with which all clients of a mount begin."""
    return MountSettings(
        sites={int(index): site for index, site in state.sites.items()},
        site=state.site,
        zone=state.zone,
        pec=state.pec,
        motors={name: value for name, value in state.motors.items() if name.startswith(MOTOR_SETTING_PREFIXES)},
    )


def to_saved_state(
    shared: MountSettings,
    driver_state: Values,
    sync_sum: SyncSum = SyncSum(),
    site: SiteOfProgram | None = None,
    last_observation: MountSnapshot | None = None,
) -> SavedState:
    """Return the state to save: these states, and the shared settings but ``manual_hertz`` and ``pulse_ends``."""
    return SavedState(
        FORMAT_VERSION,
        sites={str(index): site for index, site in shared.sites.items() if site != UNNAMED_SITE},
        site=shared.site,
        zone=shared.zone,
        pec=shared.pec,
        motors=dict(shared.motors),
        mount=driver_state,
        synced=sync_sum,
        left=last_observation,
        site_of_program=site,
    )
