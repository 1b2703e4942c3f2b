"""Access rules: which hosts may connect to a surface, and which of them may only read.

The protocols have no users or passwords, so only the host identifies a client. This module decides by kind of
operation, for every protocol alike, what a read-only client may do: it may read, and it may stop the mount, because a
stop is never refused. A read-only client sees the state that all clients share and cannot change it.
"""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from typing import NamedTuple

from msgspec import Struct

from gateway.core.errors import Fault, NotFromNetwork, ReadOnly, UserError
from gateway.core.operations import AbortMotion, AbortSlew, Focus, Hibernate, Operation, Read, StopAxis
from gateway.core.wire_log import WireLog
from gateway.system.file_limits import no_room_reason
from gateway.transport.handler import ConnectionRefused, NewConnection
from gateway.transport.room import host_capacity

Networks = tuple[IPv4Network | IPv6Network, ...]


def parse_networks(texts: Sequence[str]) -> Networks:
    """Parse networks such as ``192.168.1.0/24`` or single addresses. Raises UserError with the correct form."""
    parsed = []
    for text in texts:
        try:
            parsed.append(ip_network(text))
        except ValueError:
            try:
                right = str(ip_network(text, strict=False))
            except ValueError:
                right = "a network such as 192.168.1.0/24, or an address"
            raise UserError(f"{text!r}: write {right}") from None
    return tuple(parsed)


#: Why a client on the network may not hibernate the mount, and the setting that allows it.
NO_HIBERNATION = (
    "not over a network, because a mount that hibernates answers no program any more; "
    "hibernate = true under [mount], or --hibernate, allows it"
)


class AccessRules(Struct, frozen=True):
    """The access rules of a surface.

    ``allow``: networks that may connect (None: all). ``read_only``: networks that may only read, or True for all.
    ``max_clients``: maximum number of clients at a time. ``may_hibernate``: network clients may hibernate the mount.
    """

    allow: Networks | None = None
    read_only: bool | Networks = False
    max_clients: int = 400
    may_hibernate: bool = False

    def admits(self, host: str) -> bool:
        return self.allow is None or _is_in(host, self.allow)

    def is_read_only(self, host: str) -> bool:
        """Whether a client from this host is read-only."""
        return self.read_only if isinstance(self.read_only, bool) else _is_in(host, self.read_only)


class Refusal(NamedTuple):
    """Why an operation is refused: the fault for the client, and the reason for the log."""

    fault: Fault
    reason: str


class Rights(Struct, frozen=True):
    """The rights of a client: whether it may only read and stop, and whether it may hibernate the mount."""

    read_only: bool = False
    may_hibernate: bool = True

    def refusal(self, operation: Operation) -> Refusal | None:
        """Return why the client may not request an operation; None if it may."""
        if self.read_only and not is_read_or_stop(operation):
            return Refusal(ReadOnly(), "read only")
        if not self.may_hibernate and isinstance(operation, Hibernate):
            return Refusal(NotFromNetwork(), NO_HIBERNATION)
        return None


class ClientAdmission:
    """Decides which connections a surface accepts. A refused host is shown by ``status``, and logged once."""

    def __init__(self, access: AccessRules, surface_number: int, wire_log: WireLog) -> None:
        self._access, self._surface, self._log = access, surface_number, wire_log

    def check(self, peer: NewConnection, connected_hosts: Sequence[str]) -> None:
        """Raise ConnectionRefused if the host of ``peer`` is not allowed, or there are too many clients or open files.
        ``connected_hosts`` has one entry for each client. For a serial line, open files are not checked.
        """
        host, most = peer.host, self._access.max_clients
        if not self._access.admits(host):
            why = "its address is not in allow"
        elif len(connected_hosts) >= most:
            why = f"there are {most} clients (max-clients) already"
        elif connected_hosts.count(host) >= (capacity := host_capacity(host, most)):
            why = f"it has {capacity} clients already, three quarters of max-clients"
        elif not peer.is_serial_line and (full := no_room_reason()):
            why = full
        else:
            return
        self._log.log_rejection(peer.name, f"connection from {host} refused on surface {self._surface}: {why}", host)
        raise ConnectionRefused


def _is_in(host: str, networks: Networks) -> bool:
    """Whether a host is in any of these networks; False for a serial line, which has no address."""
    try:
        address = ip_address(host)
    except ValueError:
        return False
    if isinstance(address, IPv6Address) and address.ipv4_mapped is not None:
        address = address.ipv4_mapped
    return any(address in network for network in networks)


def is_read_or_stop(operation: Operation) -> bool:
    """Whether an operation only reads or ends a motion, so that a read-only client may request it."""
    if isinstance(operation, Focus):
        return operation.direction == 0
    return isinstance(operation, Read | AbortMotion | StopAxis | AbortSlew)
