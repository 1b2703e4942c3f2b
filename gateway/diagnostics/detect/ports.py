"""Which ports there are, by what name they are best called, and whether somebody has them already."""

from __future__ import annotations

import os
from pathlib import Path

from msgspec import Struct

from gateway.app.config.endpoints import Endpoint, parse_endpoint, right
from gateway.core.errors import UserError
from gateway.protocols.registry import mounts

#: Where Linux keeps names of USB ports that outlast a change of sockets.
LASTING = Path("/dev/serial/by-id")


class SerialPortInfo(Struct, frozen=True):
    """A port to look at: ``url`` is opened, ``name`` is what to write into a configuration, ``about`` is what the
    system says of it. ``named`` is an endpoint that the user gave, with the protocol to expect."""

    url: str
    name: str
    about: str = ""
    named: Endpoint | None = None

    @property
    def has_rates(self) -> bool:
        """Whether it is a serial port; what is behind a network address has a rate of its own already."""
        return "://" not in self.url or self.url.startswith(("hwgrep://", "spy://"))


def here() -> list[SerialPortInfo]:
    """All serial ports of this computer. Pseudo-terminals are none: these must be named."""
    from serial.tools.list_ports import comports

    found = []
    for port in sorted(comports(), key=lambda port: port.device):
        about = port.description if port.description not in (None, "n/a", port.device) else ""
        found.append(SerialPortInfo(port.device, lasting_name(port.device), about))
    return found


def named(text: str) -> SerialPortInfo:
    """A port that the user typed: a device, a pyserial URL, or an endpoint ``PROTOCOL[:MODEL]@WHERE``. Raises
    UserError."""
    what, at, where = text.partition("@")
    if at and "://" not in what and not what.startswith(("/", ".", "~")):
        endpoint = parse_endpoint(f"{what}@{right(where, listening=False) or where}")
        if endpoint.protocol not in mounts():
            listed = " or ".join(f"{name}@{where}" for name in mounts())
            raise UserError(f"{text}: programs speak {endpoint.protocol}, and no mount does; write {where} or {listed}")
        return SerialPortInfo(endpoint.where, endpoint.where, named=endpoint)
    port = right(text, listening=False) or text
    return SerialPortInfo(port, port)


def lasting_name(device: str, folder: Path = LASTING) -> str:
    """The name of a port that stays the same when it is plugged in elsewhere; its own name where it has none."""
    try:
        links = sorted(folder.iterdir())
    except OSError:
        return device
    real = os.path.realpath(device)
    return next((str(link) for link in links if os.path.realpath(link) == real), device)


def holder(url: str) -> str:
    """The program that has a port open, ``name (process 123)``; empty where nobody has or nobody can tell.

    Locks are asked for as well when the port is opened; this finds programs that take none, before anything is done to
    their port. The slave of a pseudo-terminal is held by whoever made it, so that says nothing.
    """
    real = os.path.realpath(url)
    if "://" in url or real.startswith("/dev/pts/"):
        return ""
    for process in sorted(Path("/proc").glob("[0-9]*")):
        try:
            if any(os.readlink(file) == real for file in (process / "fd").iterdir()):
                return f"{(process / 'comm').read_text().strip()} (process {process.name})"
        except OSError:
            continue  # it ended, or is another user's
    return ""
