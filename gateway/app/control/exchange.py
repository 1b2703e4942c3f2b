"""Endpoint files and authenticated datagrams, by which commands and gateways reach each other.

An endpoint file contains a gateway's port and secret. An invalid file (half written, a directory, another program's) is
ignored and never hides the others. A killed gateway leaves its file behind; the next gateway, or ``stop``, removes it
if nothing listens on its port. A datagram is ``HMAC NUMBER TEXT``: the client chooses a number, the answer repeats it,
and the HMAC of number and text is made with the secret. The text is ``ask`` with a request in JSON, ``wait`` to confirm
that it was received, or ``tell`` with a numbered part of the ``Answer`` in JSON.
"""

from __future__ import annotations

import contextlib
import hmac
import os
import socket
import stat
from pathlib import Path

import msgspec
from msgspec import Struct

from gateway.system.runtime_folders import user_id

ENDPOINT_SUFFIX = ".control"
#: At most so many bytes of an endpoint file are read.
MAX_ENDPOINT_BYTES = 65536
#: Characters in a part of an answer: 8 kB at most, because a datagram holds 9 kB on macOS.
MAX_PART_CHARACTERS = 2000
#: Confirms that a request was received and is being carried out.
WAIT_REPLY = "wait"
#: Larger datagrams are ignored.
MAX_DATAGRAM = 9216


class ControlEndpoint(Struct, frozen=True):
    """The content of an endpoint file: the mount's endpoint, and the gateway's process, port, secret and state folder.

    ``name`` is the mount's name, empty if the mount has none.
    """

    mount: str
    pid: int
    port: int
    secret: str
    state: str = ""
    name: str = ""

    @property
    def title(self) -> str:
        """The mount's name; its endpoint if it has no name."""
        return self.name or self.mount

    def matches(self, mount_name: str | None) -> bool:
        """Whether ``mount_name`` is this mount's name, endpoint or port; None matches every mount."""
        return mount_name is None or mount_name in (self.name, self.mount, self.mount.partition("@")[2])


def read_endpoints(folder: Path, owner_uid: int | None = None) -> list[tuple[Path, ControlEndpoint]]:
    """Return the valid endpoint files in a folder, of one user or of all (None). Raises OSError for the folder."""
    endpoints = []
    for name in sorted(os.listdir(folder)):
        if name.endswith(ENDPOINT_SUFFIX):
            with contextlib.suppress(OSError, ValueError, RecursionError):  # msgspec's errors are ValueErrors
                content = _read_owned_file(folder / name, owner_uid)
                endpoints.append((folder / name, msgspec.json.decode(content, type=ControlEndpoint)))
    return endpoints


def _read_owned_file(path: Path, owner_uid: int | None) -> bytes:
    """Read a regular file. Raises OSError for anything else, or for a file of another user than ``owner_uid``."""
    number = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    with open(number, "rb") as file:
        status = os.fstat(number)
        if not stat.S_ISREG(status.st_mode) or (owner_uid is not None and status.st_uid != owner_uid):
            raise OSError("no file of this user's")
        return file.read(MAX_ENDPOINT_BYTES)


def is_listening(endpoint: ControlEndpoint) -> bool:
    """Whether a process listens on the port of an endpoint: then the port cannot be bound."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", endpoint.port))
        except (OSError, OverflowError):
            return True
    return False


def motion_markers(endpoint: ControlEndpoint) -> list[Path]:
    """Return the motion markers (``*.moving``) in the state folder of a gateway."""
    return sorted(Path(endpoint.state).glob("*.moving")) if endpoint.state else []


def remove_stale_files(folder: Path) -> None:
    """Delete the endpoint files of ended gateways, except those that lead to a motion marker. Raises OSError."""
    for path, endpoint in read_endpoints(folder, user_id()):
        if not is_listening(endpoint) and not motion_markers(endpoint):
            with contextlib.suppress(OSError):
                path.unlink()


def sign(secret: str, request_number: str, text: str) -> bytes:
    """Return a datagram: the request number and the text, preceded by their HMAC."""
    sealed = f"{request_number} {text}"
    return f"{_hmac_of(secret, sealed)} {sealed}".encode()


def verify(secret: str, data: bytes) -> tuple[str, str] | None:
    """Return the request number and text of a datagram; None if it is too long or not signed with this secret."""
    given, _, sealed = data.decode("utf-8", "replace").partition(" ")
    if len(data) > MAX_DATAGRAM or not hmac.compare_digest(given.encode(), _hmac_of(secret, sealed).encode()):
        return None
    number, _, text = sealed.partition(" ")
    return number, text


def _hmac_of(secret: str, content: str) -> str:
    return hmac.digest(secret.encode(), content.encode(), "sha256").hex()


def to_datagrams(text: str) -> list[str]:
    """Split an answer into texts ``tell INDEX COUNT PART`` that each fit into a datagram."""
    pieces = [text[start : start + MAX_PART_CHARACTERS] for start in range(0, len(text), MAX_PART_CHARACTERS)] or [""]
    return [f"tell {place} {len(pieces)} {piece}" for place, piece in enumerate(pieces)]


class AnswerParts:
    """Collects the parts of an answer, in whatever order they arrive."""

    def __init__(self) -> None:
        self._parts_by_index: dict[int, str] = {}

    def add(self, text: str) -> str | None:
        """Add a part; return the answer if it is complete now, else None. A text that is no part is ignored."""
        word, _, rest = text.partition(" ")
        place, _, rest = rest.partition(" ")
        count, _, piece = rest.partition(" ")
        if word == "tell" and place.isdecimal() and count.isdecimal() and int(place) < int(count):
            self._parts_by_index[int(place)] = piece
            if len(self._parts_by_index) == int(count):
                return "".join(self._parts_by_index[index] for index in sorted(self._parts_by_index))
        return None
