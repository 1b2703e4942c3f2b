"""Accepts the programs of a protocol that may never be spoken here: it is made when the first one comes."""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import Access
from gateway.clients.connection import ClientConnection
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Write


class LateAcceptor:
    """``make`` makes the one that it stands for."""

    #: It names no model.
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
        """A new connection. Raises ConnectionRefused."""
        return self._one.arrive(name, host, write)

    def admit(self, name: str, host: str) -> None:
        """See whether a connection may be. Raises ConnectionRefused."""
        self._one.admit(name, host)

    def come(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """A new connection that has been admitted."""
        return self._one.come(name, host, write)

    def here(self) -> list[str]:
        """The hosts of the programs that seem to be here."""
        return [] if self._made is None else self._made.here()

    def connections(self) -> list[ClientConnection]:
        """The programs that are connected."""
        return [] if self._made is None else self._made.connections()

    def located(self, where: str) -> None:
        """It has no place of its own."""
