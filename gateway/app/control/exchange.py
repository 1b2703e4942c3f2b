"""What a command and a gateway must share to speak to each other: endpoint files, and sealed datagrams.

An endpoint file tells where a gateway listens, and the secret. One that cannot be read as such (half written, a
directory, another program's) is ignored and never hides those beside it. A file outlives a gateway that was killed;
whoever finds that nobody listens on its port removes it. A datagram is ``SEAL NUMBER TEXT``. The number is drawn by the
side that asks and repeated in the answer; the seal is an HMAC of the rest. A long answer is sent in numbered parts,
because the system limits the size of a datagram.
"""

from __future__ import annotations

import contextlib
import hmac
import os
import secrets
import socket
import stat
from pathlib import Path

import msgspec
from msgspec import Struct

from gateway.system.runtime_folders import user

ENDING = ".control"
#: Bytes of an endpoint file that are read.
LONGEST = 65536
#: Characters of a part: 8 kB at most, as 9 kB are what a datagram holds on macOS.
PART = 2000
#: Says that an order was heard and is being carried out.
WAIT = "wait"
#: The largest datagram that is looked at.
LARGEST = 9216


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


def draw() -> str:
    """A number that nobody has drawn before."""
    return secrets.token_hex(8)


def seal(secret: str, number: str, text: str) -> bytes:
    """A datagram."""
    told = f"{number} {text}"
    return f"{_seal(secret, told)} {told}".encode()


def unseal(secret: str, data: bytes) -> tuple[str, str] | None:
    """-> the number and the text, or None for what was not sealed with this secret."""
    given, _, told = data.decode("utf-8", "replace").partition(" ")
    if len(data) > LARGEST or not hmac.compare_digest(given.encode(), _seal(secret, told).encode()):
        return None
    number, _, text = told.partition(" ")
    return number, text


def _seal(secret: str, told: str) -> str:
    return hmac.digest(secret.encode(), told.encode(), "sha256").hex()


def parts(text: str) -> list[str]:
    """An answer as ``tell PLACE COUNT PART``, in as many as it takes."""
    pieces = [text[start : start + PART] for start in range(0, len(text), PART)] or [""]
    return [f"tell {place} {len(pieces)} {piece}" for place, piece in enumerate(pieces)]


class Parts:
    """The parts of an answer, in whatever order they come."""

    def __init__(self) -> None:
        self._pieces: dict[int, str] = {}

    def add(self, text: str) -> str | None:
        """One of them -> the answer when it was the last that was missing. What is no part is ignored."""
        word, _, rest = text.partition(" ")
        place, _, rest = rest.partition(" ")
        count, _, piece = rest.partition(" ")
        if word == "tell" and place.isdecimal() and count.isdecimal() and int(place) < int(count):
            self._pieces[int(place)] = piece
            if len(self._pieces) == int(count):
                return "".join(self._pieces[index] for index in sorted(self._pieces))
        return None
