"""Notices that a client speaks the wrong protocol because the wrong telescope type was selected in it.

The complete commands at the start of a connection decide this. The gateway warns but refuses nothing, because some
programs try another protocol first and then continue in the surface's protocol.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.strangers import IDLE_BYTES
from gateway.core.wire_log import printable
from gateway.mount.controller import MountController
from gateway.protocols.base.frames import Framer
from gateway.protocols.registry import PROTOCOLS, streams
from gateway.protocols.wireformat.command_set import CommandSet, load

#: The gateway warns if no command of the surface's own protocol arrives within this many seconds of the first bytes.
OWN_COMMAND_WINDOW = 3.0
#: How many bytes of a connection are stored to recognise another protocol; how many hosts are remembered.
MAX_CHECKED_BYTES, MAX_HOSTS = 64, 1000


def other_protocol_command(served_protocol: str, received: bytes) -> tuple[str, bytes] | None:
    """Return the other protocol whose commands these bytes are, and the first command; None if there is none."""
    for protocol in streams():
        if protocol != served_protocol and (first := _first_command(load(protocol), received.lstrip(IDLE_BYTES))):
            return protocol, first
    return None


def _first_command(command_set: CommandSet, received: bytes) -> bytes:
    """Return the first command if all bytes are commands (the last may be incomplete); else empty."""
    first = command_set.first_command(received)
    remaining = received
    while command := command_set.first_command(remaining):
        remaining = remaining[len(command) :].lstrip(IDLE_BYTES)
    return first if command_set.may_begin(remaining) else b""


def other_telescope_type(served_protocol: str, received: bytes) -> str:
    """Return the telescope type to select for the other protocol that these bytes belong to; empty if there is none."""
    match = other_protocol_command(served_protocol, received)
    return PROTOCOLS[match[0]].menu_entry if match else ""


def advice(served_protocol: str, received: bytes, address: str) -> str:
    """Return advice for the user of a client that has sent only these bytes; empty if no other protocol matches.
    ``address`` is the address of the surface; the advice suggests another surface at a similar address.
    """
    match = other_protocol_command(served_protocol, received)
    if match is None:
        return ""
    protocol, first = match
    theirs, ours = PROTOCOLS[protocol], PROTOCOLS[served_protocol]
    return (
        f"sends `{printable(first)}`: this looks like {theirs.program_phrase} program on {ours.program_phrase} "
        f'surface. Choose a type like "{ours.menu_entry}" in the program, or add --surface '
        f"{protocol}@{_neighbouring_address(address)}"
    )


def _neighbouring_address(address: str) -> str:
    """Return an address for another surface: the next port number, or the path with ``-2`` appended."""
    start, colon, port = address.rpartition(":")
    if "://" in address and colon and port.isdecimal():
        return f"{start}:{(int(port) + 1) % 65536}"
    return f"{address}-2"


class WrongProtocolWatch:
    """Finds clients with the wrong telescope type on the surface at ``address``; ``warn`` is called once per host.

    Every such client is added to the wire log's recent notices. ``make_framer`` makes a framer for ``served_protocol``,
    the surface's protocol. ``is_single_protocol`` is False for a surface that serves every protocol: every type works
    there, so nobody is warned.
    """

    def __init__(
        self,
        controller: MountController,
        served_protocol: str,
        make_framer: Callable[[], Framer],
        address: str,
        warn: Callable[[str], None],
        is_single_protocol: bool = True,
    ) -> None:
        self.controller, self.served_protocol, self.address, self.warn = controller, served_protocol, address, warn
        self._make_framer, self._is_single_protocol = make_framer, is_single_protocol
        self._last_use_by_host: dict[str, float] = {}
        self._warned_hosts: set[str] = set()

    def start_command_check(self, connection_name: str, host: str) -> FirstCommandCheck:
        return FirstCommandCheck(self, connection_name, host, self._make_framer())

    def note_protocol_used(self, host: str) -> None:
        """Record that a client on this host has used the surface's own protocol."""
        if len(self._last_use_by_host) >= MAX_HOSTS:
            self._last_use_by_host.clear()
        self._last_use_by_host[host] = self.controller.now()

    def used_protocol_since(self, host: str, started_at: float) -> bool:
        """Whether a client on this host has used the surface's own protocol since ``started_at``."""
        return self._last_use_by_host.get(host, -1e9) >= started_at

    def warn_about(self, connection_name: str, host: str, received: bytes) -> None:
        """Warn of a connection that sent only these bytes and no command of the surface's own protocol."""
        if not (text := advice(self.served_protocol, received, self.address) if self._is_single_protocol else ""):
            return
        self.controller.wire_log.remember_notice(host, text)
        if host not in self._warned_hosts and len(self._warned_hosts) < MAX_HOSTS:
            self._warned_hosts.add(host)
            self.warn(f"{connection_name} {text}")


class FirstCommandCheck:
    """Examines a connection's bytes up to a command of the surface's own protocol, or for ``OWN_COMMAND_WINDOW``."""

    def __init__(self, protocol_watch: WrongProtocolWatch, name: str, host: str, framer: Framer) -> None:
        self._protocol_watch, self._connection_name, self._host, self._framer = protocol_watch, name, host, framer
        self._received = b""
        #: Whether no more bytes are needed.
        self.is_done = False

    def feed(self, data: bytes) -> None:
        watch = self._protocol_watch
        if not self._received:
            began = watch.controller.now()
            watch.controller.loop.call_later(OWN_COMMAND_WINDOW, self._warn_if_wrong_protocol, began)
        self._received = (self._received + data)[:MAX_CHECKED_BYTES]
        if any(
            load(watch.served_protocol).find(frame) is not None
            for frame in self._framer.feed(data, watch.controller.now())
        ):
            watch.note_protocol_used(self._host)
            self.is_done = True

    def end(self) -> None:
        """Stop examining: the client is no telescope program."""
        self.is_done = True

    def _warn_if_wrong_protocol(self, started_at: float) -> None:
        """Warn if the host has not used the surface's own protocol, on any connection, since ``started_at``."""
        if not self.is_done and not self._protocol_watch.used_protocol_since(self._host, started_at):
            self._protocol_watch.warn_about(self._connection_name, self._host, self._received)
        self.is_done = True
