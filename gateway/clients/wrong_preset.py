"""Notices that a client speaks the wrong protocol because the wrong telescope type was selected in it.

The complete commands at the start of a connection decide this. The gateway warns but refuses nothing, because some
programs try another protocol first and then continue in the surface's protocol.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.strangers import IDLE_BYTES
from gateway.core.wire_log import show
from gateway.mount.controller import MountController
from gateway.protocols.base.frames import Framer
from gateway.protocols.registry import PROTOCOLS, streams
from gateway.protocols.wireformat.command_set import CommandSet, load

#: Seconds from the first bytes to a command of the surface's own protocol, after which the gateway warns.
OWN_COMMAND_WINDOW = 3.0
#: Maximum number of bytes that are examined of a connection, and of hosts that are remembered.
MAX_BYTES, MAX_HOSTS = 64, 1000


def foreign(served_protocol: str, received: bytes) -> tuple[str, bytes] | None:
    """Return the other protocol whose commands these bytes are, and the first command; None if there is none."""
    for protocol in streams():
        if protocol != served_protocol and (first := _first_command(load(protocol), received.lstrip(IDLE_BYTES))):
            return protocol, first
    return None


def _first_command(protocol: CommandSet, received: bytes) -> bytes:
    """Return the first command if all bytes are commands (the last may be incomplete); else empty."""
    first = protocol.first(received)
    rest = received
    while command := protocol.first(rest):
        rest = rest[len(command) :].lstrip(IDLE_BYTES)
    return first if protocol.may_begin(rest) else b""


def other(served_protocol: str, received: bytes) -> str:
    """Return the telescope type to select for the other protocol that these bytes belong to; empty if there is none."""
    match = foreign(served_protocol, received)
    return PROTOCOLS[match[0]].preset if match else ""


def advice(served_protocol: str, received: bytes, where: str) -> str:
    """Return advice for the user of a client that has sent only these bytes; empty if no other protocol matches.

    ``where`` is the address of the surface; the advice suggests another surface at a similar address.
    """
    match = foreign(served_protocol, received)
    if match is None:
        return ""
    protocol, first = match
    theirs, ours = PROTOCOLS[protocol], PROTOCOLS[served_protocol]
    return (
        f"sends `{show(first)}`: this looks like {theirs.a_program} program on {ours.a_program} surface. "
        f'Choose a type like "{ours.preset}" in the program, or add --surface {protocol}@{_neighbouring_address(where)}'
    )


def _neighbouring_address(where: str) -> str:
    """Return a similar address for another surface."""
    start, colon, port = where.rpartition(":")
    if "://" in where and colon and port.isdecimal():
        return f"{start}:{(int(port) + 1) % 65536}"
    return f"{where}-2"


class PresetWatch:
    """Finds clients with the wrong telescope type on the surface at ``where``; ``warn`` is called once per host.

    The recent events list every such client. ``framing`` makes a framer for the surface's protocol
    ``served_protocol``. ``sends_one_type``: the surface is for a single protocol; on a surface for every protocol any
    type fits, so nobody is warned.
    """

    def __init__(
        self,
        controller: MountController,
        served_protocol: str,
        framing: Callable[[], Framer],
        where: str,
        warn: Callable[[str], None],
        sends_one_type: bool = True,
    ) -> None:
        self.controller, self.served, self.address, self.warn = controller, served_protocol, where, warn
        self._framing, self._sends_one_type = framing, sends_one_type
        self._last_spoken_at: dict[str, float] = {}
        self._warned_hosts: set[str] = set()

    def listen(self, name: str, host: str) -> FirstCommands:
        return FirstCommands(self, name, host, self._framing())

    def spoke(self, host: str) -> None:
        """Record that a client on this host has used the surface's own protocol."""
        if len(self._last_spoken_at) >= MAX_HOSTS:
            self._last_spoken_at.clear()
        self._last_spoken_at[host] = self.controller.now()

    def spoke_since(self, host: str, started_at: float) -> bool:
        """Whether a client on this host has used the surface's own protocol since ``started_at``."""
        return self._last_spoken_at.get(host, -1e9) >= started_at

    def warn_of(self, name: str, host: str, received: bytes) -> None:
        """Warn of a connection that sent only these bytes and no command of the surface's own protocol."""
        if not (text := advice(self.served, received, self.address) if self._sends_one_type else ""):
            return
        self.controller.wire_log.remember(host, text)
        if host not in self._warned_hosts and len(self._warned_hosts) < MAX_HOSTS:
            self._warned_hosts.add(host)
            self.warn(f"{name} {text}")


class FirstCommands:
    """Examines the first bytes of a connection until they contain a command of the surface's own protocol."""

    def __init__(self, presets: PresetWatch, name: str, host: str, framer: Framer) -> None:
        self._presets, self._connection_name, self._host, self._framer = presets, name, host, framer
        self._received = b""
        #: Whether no more bytes are needed.
        self.is_done = False

    def feed(self, data: bytes) -> None:
        presets = self._presets
        if not self._received:
            began = presets.controller.now()
            presets.controller.loop.call_later(OWN_COMMAND_WINDOW, self._decide, began)
        self._received = (self._received + data)[:MAX_BYTES]
        if any(
            load(presets.served).find(frame) is not None for frame in self._framer.feed(data, presets.controller.now())
        ):
            presets.spoke(self._host)
            self.is_done = True

    def end(self) -> None:
        """Stop examining: the client is no telescope program."""
        self.is_done = True

    def _decide(self, started_at: float) -> None:
        """Warn if the time is up without a command of the right protocol, here or on another connection of the host."""
        if not self.is_done and not self._presets.spoke_since(self._host, started_at):
            self._presets.warn_of(self._connection_name, self._host, self._received)
        self.is_done = True
