"""Notices that a client speaks the wrong protocol because the wrong telescope type was selected in it.

This is decided by the whole commands at the start of a connection. Nothing is refused because of it: some programs try
another protocol first and then continue in the surface's own.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.strangers import IDLE_BYTES
from gateway.core.wire_log import show
from gateway.mount.controller import MountController
from gateway.protocols.base.frames import Framer
from gateway.protocols.registry import PROTOCOLS, streams
from gateway.protocols.wireformat.command_set import CommandSet, load

#: Seconds within which a command of the surface's own protocol must follow.
OWN_COMMAND_WINDOW = 3.0
#: Bytes of a connection that are examined, and hosts that are remembered.
MAX_BYTES, MAX_HOSTS = 64, 1000


def foreign(served: str, sent: bytes) -> tuple[str, bytes] | None:
    """Return the other protocol to which these bytes belong, and the first command; None if they belong to none."""
    for protocol in streams():
        if protocol != served and (first := _first_command(load(protocol), sent.lstrip(IDLE_BYTES))):
            return protocol, first
    return None


def _first_command(protocol: CommandSet, sent: bytes) -> bytes:
    """Return the first command, if there are only commands (the last may be incomplete); else empty."""
    first = protocol.first(sent)
    rest = sent
    while command := protocol.first(rest):
        rest = rest[len(command) :].lstrip(IDLE_BYTES)
    return first if protocol.may_begin(rest) else b""


def other(served: str, sent: bytes) -> str:
    """Return the telescope type of the other protocol to which these bytes belong; empty if they belong to no other."""
    match = foreign(served, sent)
    return PROTOCOLS[match[0]].preset if match else ""


def advice(served: str, sent: bytes, where: str) -> str:
    """Return the advice for a connection that has sent only these bytes; empty if they are of no other protocol.

    ``where`` is the address of the surface; the advice offers a neighbouring address.
    """
    match = foreign(served, sent)
    if match is None:
        return ""
    protocol, first = match
    theirs, ours = PROTOCOLS[protocol], PROTOCOLS[served]
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

    The recent events list every such client. ``framing`` splits bytes into commands of the surface's protocol
    ``served``. ``one_type``: the surface is for a single protocol; on a surface for every protocol any type fits.
    """

    def __init__(
        self,
        controller: MountController,
        served: str,
        framing: Callable[[], Framer],
        where: str,
        warn: Callable[[str], None],
        one_type: bool = True,
    ) -> None:
        self.controller, self.served, self.where, self.warn = controller, served, where, warn
        self._framing, self._one_type = framing, one_type
        self._spoke: dict[str, float] = {}
        self._warned: set[str] = set()

    def listen(self, name: str, host: str) -> FirstCommands:
        return FirstCommands(self, name, host, self._framing())

    def spoke(self, host: str) -> None:
        """A client has used the surface's own protocol."""
        if len(self._spoke) >= MAX_HOSTS:
            self._spoke.clear()
        self._spoke[host] = self.controller.now()

    def spoke_since(self, host: str, began: float) -> bool:
        """Whether a client on this host has used it since ``began``."""
        return self._spoke.get(host, -1e9) >= began

    def warn_of(self, name: str, host: str, sent: bytes) -> None:
        """Warn of a connection that sent only these bytes and no command of the surface's own protocol."""
        if not (text := advice(self.served, sent, self.where) if self._one_type else ""):
            return
        self.controller.wire_log.remember(host, text)
        if host not in self._warned and len(self._warned) < MAX_HOSTS:
            self._warned.add(host)
            self.warn(f"{name} {text}")


class FirstCommands:
    """Examines the first bytes of a connection until they contain a command of the surface's own protocol."""

    def __init__(self, presets: PresetWatch, name: str, host: str, framer: Framer) -> None:
        self._presets, self._name, self._host, self._framer = presets, name, host, framer
        self._sent = b""
        #: Whether no more bytes are needed.
        self.done = False

    def feed(self, data: bytes) -> None:
        presets = self._presets
        if not self._sent:
            began = presets.controller.now()
            presets.controller.loop.call_later(OWN_COMMAND_WINDOW, self._decide, began)
        self._sent = (self._sent + data)[:MAX_BYTES]
        if any(
            load(presets.served).find(frame) is not None for frame in self._framer.feed(data, presets.controller.now())
        ):
            presets.spoke(self._host)
            self.done = True

    def end(self) -> None:
        """Stop examining: the client is no telescope program."""
        self.done = True

    def _decide(self, began: float) -> None:
        """The time is up. The client may have disconnected and used the right protocol on another connection."""
        if not self.done and not self._presets.spoke_since(self._host, began):
            self._presets.warn_of(self._name, self._host, self._sent)
        self.done = True
