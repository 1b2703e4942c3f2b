"""Accepts the connections of a port for every protocol.

For each protocol there is an acceptor, as behind a port of its own; a connection is given to one of them when it is
known what its program speaks. Who may come in, and how many, holds for all of them together.
"""

from __future__ import annotations

from collections.abc import Mapping

from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import Admission
from gateway.clients.any_protocol.connection import AnyConnection
from gateway.clients.any_protocol.web import Web
from gateway.clients.connection import ClientConnection
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Write


class AnyAcceptor:
    """``speaking`` are the acceptors by protocol, and ``web`` has what speaks HTTP."""

    #: Each protocol's programs are presented one of their own.
    model: str | None = None

    def __init__(self, speaking: Mapping[str, ConnectionAcceptor], web: Web) -> None:
        self._speaking, self._web = speaking, web
        first = next(iter(speaking.values()))
        self.controller, self.number, self.access = first.controller, first.number, first.access
        self._admission = Admission(self.access, self.number, self.controller.wire_log)
        self._connections: set[AnyConnection] = set()

    def arrive(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """A new connection. Raises ConnectionRefused."""
        self.admit(name, host)
        return self.come(name, host, write)

    def admit(self, name: str, host: str) -> None:
        """See whether a connection may be. Raises ConnectionRefused."""
        unknown = sum(not connection.decided for connection in self._connections)
        self._admission.check(name, host, unknown + sum(one.clients() for one in self._speaking.values()))

    def come(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """A new connection that has been admitted."""
        wire_log = self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.number}, host {host}")

        def left() -> None:
            self._connections.discard(connection)
            wire_log.put(name, "-")

        connection = AnyConnection(self._speaking, self._web, self.controller, name, host, write, left)
        self._connections.add(connection)
        return connection

    def here(self) -> list[str]:
        """The hosts of the programs that seem to be here."""
        connected = [host for one in self._speaking.values() for host in one.connected()]
        between = {host for one in self._speaking.values() for host in one.between()}
        return connected + sorted(between.difference(connected))

    def connections(self) -> list[ClientConnection]:
        """The programs that are connected."""
        return [visit for one in self._speaking.values() for visit in one.connections()]

    def located(self, where: str) -> None:
        """The port is open, and has its real number."""
        for one in self._speaking.values():
            one.located(where)
