"""Endpoint files: what a command must know to reach a gateway.

A file that cannot be read as one (half written, a directory, another program's) is ignored and never hides those beside
it. A file outlives a gateway that was killed; whoever finds that nobody listens on its port removes it.
"""

from __future__ import annotations

import contextlib
import os
import socket
import stat
from pathlib import Path

import msgspec
from msgspec import Struct

from gateway.system.runtime_folders import user

ENDING = ".control"
LONGEST = 65536


class ControlEndpoint(Struct, frozen=True):
    """Which mount, which process, the port that it listens on, and the folder that it keeps its state in.

    ``name`` is what the mount is called, where it is called anything.
    """

    mount: str
    pid: int
    port: int
    secret: str
    state: str = ""
    name: str = ""


def doors(folder: Path, owner: int | None = None) -> list[tuple[Path, ControlEndpoint]]:
    """Those in a folder; with ``owner`` only that user's. Raises OSError where it cannot be looked into."""
    found = []
    for name in sorted(os.listdir(folder)):
        if name.endswith(ENDING):
            with contextlib.suppress(OSError, ValueError, RecursionError):  # msgspec's errors are ValueErrors
                found.append((folder / name, msgspec.json.decode(_content(folder / name, owner), type=ControlEndpoint)))
    return found


def _content(path: Path, owner: int | None) -> bytes:
    """A plain file, whatever stands in its place. Raises OSError."""
    number = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with open(number, "rb") as file:
        seen = os.fstat(number)
        if not stat.S_ISREG(seen.st_mode) or (owner is not None and seen.st_uid != owner):
            raise OSError("no file of this user's")
        return file.read(LONGEST)


def listened(door: ControlEndpoint) -> bool:
    """Whether anybody has its port: one that can be had is nobody's."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", door.port))
        except (OSError, OverflowError):
            return True
    return False


def sweep(folder: Path) -> None:
    """Take away what killed gateways have left. Raises OSError."""
    for path, door in doors(folder, user()):
        if not listened(door):
            with contextlib.suppress(OSError):
                path.unlink()
