"""The serial ports of this computer: their stable names, and whether another program has them open."""

from __future__ import annotations

import os
import re
from pathlib import Path
from urllib.parse import urlsplit

from msgspec import Struct

from gateway.app.config.endpoints import Endpoint, parse_endpoint, suggest_address
from gateway.app.control.reach import Scope, may_reach, search
from gateway.app.state.mount_claim import lock_name
from gateway.core.errors import UserError
from gateway.protocols.registry import PROTOCOLS, drivers
from gateway.system.files import state_folder
from gateway.system.processes import gateways, holders_of, is_gateway
from gateway.system.runtime_folders import user_name

#: The folder in which Linux lists USB serial ports by names that stay the same in another USB socket.
PERSISTENT_PORTS_FOLDER = Path("/dev/serial/by-id")
#: The port name of a simulated mount; two gateways with this name do not share a mount.
SIMULATED_PORT = "sim"


class SerialPortInfo(Struct, frozen=True):
    """A port to examine: ``url`` is opened, ``name`` is for the configuration, ``about`` is the system's description.
    ``typed_endpoint`` is the endpoint that the user typed, if any: it names the protocol to expect.
    """

    url: str
    name: str
    about: str = ""  # the system's description
    typed_endpoint: Endpoint | None = None

    @property
    def has_baud_setting(self) -> bool:
        """Whether the gateway can set the baud rate; a network adapter has a setting of its own."""
        return "://" not in self.url or self.url.startswith(("hwgrep://", "spy://"))


def local_ports() -> list[SerialPortInfo]:
    """List the serial ports of this computer. Pseudo-terminals are not included; users must name them."""
    from serial.tools.list_ports import comports

    ports = []
    for port in sorted(comports(), key=lambda port: port.device):
        about = port.description if port.description not in (None, "n/a", port.device) else ""
        ports.append(SerialPortInfo(port.device, persistent_name(port.device), about))
    return ports


def is_not_built_in(url: str) -> bool:
    """Whether a port is not one of those built into a PC or a Raspberry Pi."""
    return not re.match(r"/dev/tty(S|AMA)\d", url)


def parse_port(text: str) -> SerialPortInfo:
    """Parse a port that the user typed: a device, a pyserial URL, or an endpoint ``PROTOCOL[:MODEL]@WHERE``. Raises
    UserError for an invalid endpoint, and for one whose protocol no mount speaks.
    """
    what, at, where = text.partition("@")
    if at and "://" not in what and not what.startswith(("/", ".", "~")):
        endpoint = parse_endpoint(f"{what}@{suggest_address(where, is_surface=False) or where}")
        if endpoint.protocol not in drivers():
            listed = " or ".join(f"{name}@{where}" for name in drivers())
            raise UserError(f"{text}: programs speak {endpoint.protocol}, and no mount does; write {where} or {listed}")
        return SerialPortInfo(endpoint.where, endpoint.where, typed_endpoint=endpoint)
    port = suggest_address(text, is_surface=False) or text
    return SerialPortInfo(port, port)


def persistent_name(device: str, folder: Path = PERSISTENT_PORTS_FOLDER) -> str:
    """Return the name of a port that stays the same in another USB socket; the device's own name if it has none."""
    try:
        links = sorted(folder.iterdir())
    except OSError:
        return device
    real = os.path.realpath(device)
    return next((str(link) for link in links if os.path.realpath(link) == real), device)


def serving_gateway_pid(url: str) -> int | None:
    """Return the process id of this user's gateway that drives the mount on this port, or None."""
    network = lock_name(url)
    for _, gateway in search(Scope(state_folder(None))).gateways:
        where = gateway.mount.partition("@")[2]
        same = lock_name(where) == network if network else os.path.realpath(where) == os.path.realpath(url)
        if same and where != SIMULATED_PORT and is_gateway(gateway.pid):
            return gateway.pid
    return None


def other_user_gateway() -> str:
    """Return a text about another user's gateway, which may be using a port; empty if there is none."""
    owner = next((process for process in gateways() if not may_reach(process)), None)
    return f"perhaps by the gateway of {user_name(owner.user_id)} (process {owner.pid})" if owner else ""


def unsupported_device_at(port: str) -> str:
    """Return advice about the unsupported device that usually listens at this network address; empty if none does."""
    try:
        url = urlsplit(port)
        names = (url.hostname, str(url.port)) if url.scheme == "socket" else ()
    except ValueError:
        return ""
    known = {name: reason for spec in PROTOCOLS.values() for name, reason in spec.unsupported_devices.items()}
    return next((known[name] for name in names if name in known), "")


def port_holder(url: str) -> str:
    """Return the program that has a port open, as ``name (process 123)``; empty if none has, or it is hidden.

    The port is not opened, and programs that have not locked it are found, too. A pseudo-terminal is not examined,
    because the program that created it always has it open.
    """
    real = os.path.realpath(url)
    if "://" in url or real.startswith("/dev/pts/"):
        return ""
    return next((f"{name} (process {number})" for _, (number, name) in holders_of([real])), "")
