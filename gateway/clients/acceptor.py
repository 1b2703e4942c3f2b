"""Accepts client connections and gives each a session.

A session lives as long as its connection. If a connection from the same host closed within the last minute, the new
session starts with a copy of its state, so that a program that opens a connection per command keeps its target. Two
programs that are connected at the same time do not disturb each other. On network ports, the gateway recognises web
browsers and port scanners by their first bytes and carries out nothing that they send.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property

from gateway.clients.access import AccessRules, ClientAdmission, Rights
from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.connection import ClientConnection
from gateway.clients.profiles import SurfaceBinding
from gateway.clients.wrong_preset import PresetWatch
from gateway.core.wire_log import ClientLog
from gateway.mount.controller import MountController
from gateway.protocols.base.session import ClientState, Shared
from gateway.transport import ConnectionHandler
from gateway.transport.handler import Connected

#: Seconds for which the state of a closed connection is saved for the next connection from its host.
INHERIT_TIME = 60.0
#: Seconds after its last byte for which a client on a serial line, or one that connects per command, counts as present.
PRESENCE_TIME = 10.0


class ConnectionAcceptor:
    """Creates the client connection for every connection to a port. ``binding`` is the surface as presented there,
    or a function that makes the binding for the first connection."""

    def __init__(
        self,
        controller: MountController,
        binding: SurfaceBinding | Callable[[], SurfaceBinding],
        shared_state: Shared,
        host_clock: Callable[[], float],
        number: int = 1,
        access: AccessRules = AccessRules(),
        where: str = "",
        warn: Callable[[str], None] = lambda text: None,
        sends_one_type: bool = True,
    ) -> None:
        self.controller, self._bind, self.shared_state, self.clock = controller, binding, shared_state, host_clock
        #: The number of the surface, counted from 1.
        self.number = number
        self.access, self._admission = access, ClientAdmission(access, number, controller.wire_log)
        self._address, self._warn, self._one_type = where, warn, sends_one_type
        self._clients: set[CommandProcessor] = set()
        self._saved_states: dict[str, tuple[float, ClientState]] = {}
        self._connections: set[ClientConnection] = set()

    @cached_property
    def binding(self) -> SurfaceBinding:
        """The surface as presented on this port."""
        return self._bind if isinstance(self._bind, SurfaceBinding) else self._bind()

    @cached_property
    def presets(self) -> PresetWatch:
        """Notices clients in which the user has selected the wrong telescope type."""
        surface = self.binding.surface
        return PresetWatch(
            self.controller, surface.protocol.name, self.binding.framing, self._address, self._warn, self._one_type
        )

    @property
    def model(self) -> str | None:
        """The name of the model that clients see; None if the protocol has no models."""
        return str(self.binding.model["name"]) if self.binding.surface.protocol.models else None

    def accept(self, connected: Connected) -> ConnectionHandler:
        """Check, log and create a new connection. A refusal is logged once per host. Raises ConnectionRefused."""
        self._admission.check(connected, self.clients())
        name, wire_log = connected.name, self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.number}, host {connected.host}")
        return self.create_silently(connected, lambda: wire_log.put(name, "-"))

    def create_silently(
        self, connected: Connected, on_closed: Callable[[], None] = lambda: None, first_bytes: bytes = b""
    ) -> ConnectionHandler:
        """Create a connection without checking the access rules or logging it.

        ``on_closed`` is called at its end. ``first_bytes``: bytes of this client that another handler has answered.
        """
        binding, controller, host = self.binding, self.controller, connected.host
        rights = Rights(self.access.is_read_only(host), self.access.hibernate or connected.hang_up is None)
        log = ClientLog(connected.name, controller.wire_log)
        session = binding.surface.session(
            binding.model,
            binding.settings,
            self.clock,
            self.shared_state,
            self._saved_state(host) if binding.surface.session.inherits else None,
            (lambda: log.refused_once("a setting refused: read only")) if rights.read_only else None,
        )
        activity = controller.presence.connected(host, self.number)
        client = CommandProcessor(connected, controller, binding, session, activity, rights)
        connection = ClientConnection(
            connected,
            client,
            binding,
            self.presets.listen(connected.name, host),
            lambda: self._leave(host, client, connection, on_closed),
            lambda: self._save_state(host, client),
            first_bytes,
        )
        self._clients.add(client)
        self._connections.add(connection)
        return connection

    def clients(self) -> list[str]:
        """Return the hosts of all clients, including disconnected clients whose operations are still under way."""
        self._clients = {client for client in self._clients if client.is_open or client.busy}
        return [client.activity.who for client in self._clients]

    def present_hosts(self) -> list[str]:
        """Return the hosts of the clients that seem present.

        A client on a serial line, or between two connections, counts as present for some seconds after its last byte.
        """
        now, connected = self.controller.now(), self.connected_hosts()
        present = [
            connection.host
            for connection in self._connections
            if not connection.stays_present or now - connection.last_received_at <= PRESENCE_TIME
        ]
        return present + [host for host in self.reconnecting_hosts() if host not in connected]

    def connected_hosts(self) -> list[str]:
        return [connection.host for connection in self._connections]

    def reconnecting_hosts(self) -> list[str]:
        """Return the hosts whose last connection ended a few seconds ago."""
        return [host for host, (at, _) in self._saved_states.items() if self.controller.now() - at <= PRESENCE_TIME]

    def connections(self) -> list[ClientConnection]:
        return [connection for connection in self._connections if not connection.stranger]

    def set_address(self, where: str) -> None:
        """Record the address of the port, with its real port number, once the port is open."""
        self._address = where

    def _leave(
        self, host: str, client: CommandProcessor, connection: ClientConnection, on_closed: Callable[[], None]
    ) -> None:
        self._connections.discard(connection)
        on_closed()
        if connection.stranger:
            self.controller.presence.forget(client.activity)
            return
        self._save_state(host, client)

    def _saved_state(self, host: str) -> ClientState | None:
        """Return the state of the last connection from this host; None if it closed too long ago."""
        at, state = self._saved_states.get(host, (-1e9, None))
        return state if self.controller.now() - at <= INHERIT_TIME else None

    def _save_state(self, host: str, client: CommandProcessor) -> None:
        """The client has disconnected: save its state for the next connection from this host."""
        if client.activity.closed is None:
            self.controller.presence.disconnected(client.activity)
        self._saved_states[host] = (self.controller.now(), copy(client.session.client))
        for old in [key for key, (at, _) in self._saved_states.items() if self.controller.now() - at > INHERIT_TIME]:
            del self._saved_states[old]
