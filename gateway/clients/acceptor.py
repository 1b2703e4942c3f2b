"""Accepts connections and gives each a session.

A session lives as long as its connection. A new one starts with a copy of the state of the connection from the same
host that closed last, within a minute: programs that open a connection per command keep their target that way, and two
programs connected at the same time do not disturb each other. On network ports, web browsers and port scanners are
recognised by their first bytes and refused before anything they send is carried out.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy

from msgspec.structs import replace

from gateway.clients.access import Access, Admission, Rights
from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.connection import ClientConnection
from gateway.clients.profiles import SurfaceBinding
from gateway.clients.wrong_preset import Presets
from gateway.mount.controller import MountController
from gateway.protocols.base.session import Kept, Shared
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Write

INHERIT_FOR = 60.0
#: Seconds for which a client on a serial line, or one that connects for each command, counts as present when silent.
HERE = 10.0


class ConnectionAcceptor:
    """Creates the client connection for every connection to one port."""

    def __init__(
        self,
        controller: MountController,
        face: SurfaceBinding,
        shared: Shared,
        host_clock: Callable[[], float],
        number: int = 1,
        access: Access = Access(),
        where: str = "",
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.controller, self.face, self.shared, self.clock = controller, face, shared, host_clock
        #: The number of the surface, counted from 1.
        self.number = number
        self.access, self._admission = access, Admission(access, number, controller.wire_log)
        self.presets = Presets(
            face.surface.protocol.name, face.framing, where, controller.now, controller.loop.call_later, warn
        )
        self._clients: set[CommandProcessor] = set()
        self._left: dict[str, tuple[float, Kept]] = {}
        self._visits: set[ClientConnection] = set()

    @property
    def model(self) -> str | None:
        """The name of the model that clients see; None if the protocol has no models."""
        return str(self.face.model["name"]) if self.face.surface.protocol.models else None

    def arrive(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """Admit a new connection. Raises ConnectionRefused."""
        self.admit(name, host)
        return self.come(name, host, write)

    def come(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """Log and create a connection that was admitted."""
        wire_log = self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.number}, host {host}")
        return self.take(name, host, write, lambda: wire_log.put(name, "-"))

    def take(
        self, name: str, host: str, write: Write, left: Callable[[], None] = lambda: None, said: bytes = b""
    ) -> ConnectionHandler:
        """Create a connection.

        ``left`` is called at its end. ``said`` are bytes that the client has sent before, which were answered
        elsewhere.
        """
        face = self.face
        session = face.surface.session(face.model, face.settings, self.clock, self.shared)
        at, kept = self._left.get(host, (-1e9, session.kept))
        if session.inherits and self.controller.now() - at <= INHERIT_FOR:
            session.kept = copy(kept)
        life = self.controller.presence.arrive(host)
        client = CommandProcessor(name, self.controller, face, session, write, life)
        client.runner.equinox = face.equinox
        self._clients.add(client)
        if self.access.only_looks(host):
            client.runner.rights = Rights(read_only=True)
            session.may_not_set = lambda: client.log.refused_once("a setting refused: read only")
        rights = replace(client.runner.rights, hibernate=self.access.hibernate)
        visit = ClientConnection(
            client,
            face,
            self.presets.listen(name, host),
            lambda: self._leave(host, client, visit, left),
            lambda: self._hand_on(host, client),
            _on_line(name, host),
            rights,
        )
        visit.said = said
        self._visits.add(visit)
        client.push()
        return visit

    def admit(self, name: str, host: str) -> None:
        """Check whether a connection is allowed; log a refusal once per host. Raises ConnectionRefused."""
        self._admission.check(name, host, self.clients(), _on_line(name, host))

    def clients(self) -> int:
        """The number of clients, including disconnected ones whose operations are still under way."""
        self._clients = {client for client in self._clients if client.open or client.busy}
        return len(self._clients)

    def here(self) -> list[str]:
        """Return the hosts of the clients that seem present.

        A client on a serial line, or between two connections, counts as present for some seconds after it was heard.
        """
        now, connected = self.controller.now(), self.connected()
        here = [visit.host for visit in self._visits if not visit.lasting or now - visit.heard <= HERE]
        return here + [host for host in self.between() if host not in connected]

    def connected(self) -> list[str]:
        return [visit.host for visit in self._visits]

    def between(self) -> list[str]:
        """Return the hosts whose last connection ended a few seconds ago."""
        return [host for host, (at, _) in self._left.items() if self.controller.now() - at <= HERE]

    def connections(self) -> list[ClientConnection]:
        return [visit for visit in self._visits if not visit.stranger]

    def located(self, where: str) -> None:
        """Take the address of the port, which is open now and has its real number."""
        self.presets.where = where

    def _leave(self, host: str, client: CommandProcessor, visit: ClientConnection, left: Callable[[], None]) -> None:
        self._visits.discard(visit)
        left()
        if visit.stranger:
            self.controller.presence.was_nobody(client.life)
            return
        self._hand_on(host, client)

    def _hand_on(self, host: str, client: CommandProcessor) -> None:
        """The client has disconnected: save its state for the next connection from this host."""
        if client.life.closed is None:
            self.controller.presence.leave(client.life)
        self._left[host] = (self.controller.now(), copy(client.session.kept))
        for old in [key for key, (at, _) in self._left.items() if self.controller.now() - at > INHERIT_FOR]:
            del self._left[old]


def _on_line(name: str, host: str) -> bool:
    """Whether a connection is a serial line or a pseudo-terminal."""
    return host.removeprefix("pty:") == name


class LateAcceptor:
    """Stands in for the acceptor of a protocol that is rarely used: ``make`` creates it for the first connection."""

    #: It presents no model.
    model: str | None = None

    def __init__(self, number: int, access: Access, make: Callable[[], ConnectionAcceptor]) -> None:
        self.number, self.access, self._make = number, access, make
        self._made: ConnectionAcceptor | None = None

    @property
    def _one(self) -> ConnectionAcceptor:
        if self._made is None:
            self._made = self._make()
        return self._made

    def arrive(self, name: str, host: str, write: Write) -> ConnectionHandler:
        return self._one.arrive(name, host, write)

    def admit(self, name: str, host: str) -> None:
        self._one.admit(name, host)

    def come(self, name: str, host: str, write: Write) -> ConnectionHandler:
        return self._one.come(name, host, write)

    def here(self) -> list[str]:
        return [] if self._made is None else self._made.here()

    def connections(self) -> list[ClientConnection]:
        return [] if self._made is None else self._made.connections()

    def located(self, where: str) -> None:
        """Ignore the address of the port."""
