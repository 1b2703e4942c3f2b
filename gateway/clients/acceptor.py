"""Accepts client connections and gives each a session.

A session lives as long as its connection. If a connection from the same host closed within the last minute, the new
session starts with a copy of the old one's state, so that a program that opens a connection per command keeps its
target. Two programs that are connected at the same time do not disturb each other. On network ports, the gateway
recognises web browsers and port scanners by their first bytes and carries out nothing that they send.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property

from gateway.clients.access import AccessRules, ClientAdmission, Rights
from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.connection import ClientConnection
from gateway.clients.profiles import SurfaceBinding
from gateway.clients.wrong_preset import WrongProtocolWatch
from gateway.core.wire_log import ClientLog
from gateway.mount.controller import MountController
from gateway.protocols.base.session import ClientState, SharedSettings
from gateway.transport import ConnectionHandler
from gateway.transport.handler import NewConnection

#: Seconds for which the state of a closed connection is saved for the next connection from its host.
MAX_STATE_AGE = 60.0
#: Seconds for which a client counts as present after it has disconnected or, on a serial line, after its last byte.
PRESENCE_TIME = 10.0


class ConnectionAcceptor:
    """Accepts the connections to a port, and creates a ``ClientConnection`` for each.
    ``binding``: how this port presents its surface, or a function that returns this when the first connection comes.
    """

    def __init__(
        self,
        controller: MountController,
        binding: SurfaceBinding | Callable[[], SurfaceBinding],
        shared_state: SharedSettings,
        computer_clock: Callable[[], float],
        surface_number: int = 1,
        access: AccessRules = AccessRules(),
        address: str = "",
        warn: Callable[[str], None] = lambda text: None,
        is_single_protocol: bool = True,
    ) -> None:
        self.controller, self._bind, self.shared_state, self.clock = controller, binding, shared_state, computer_clock
        #: The number of the surface, counted from 1.
        self.surface_number = surface_number
        self.access, self._admission = access, ClientAdmission(access, surface_number, controller.wire_log)
        self._address, self._warn, self._is_single = address, warn, is_single_protocol
        self._clients: set[CommandProcessor] = set()
        self._saved_states: dict[str, tuple[float, ClientState]] = {}
        self._connections: set[ClientConnection] = set()

    @cached_property
    def binding(self) -> SurfaceBinding:
        """How this port presents its surface: with which model, settings, equinox and profiles of client programs."""
        return self._bind if isinstance(self._bind, SurfaceBinding) else self._bind()

    @cached_property
    def protocol_watch(self) -> WrongProtocolWatch:
        """Notices clients in which the user has selected the wrong telescope type."""
        surface = self.binding.surface
        return WrongProtocolWatch(
            self.controller, surface.protocol.name, self.binding.make_framer, self._address, self._warn, self._is_single
        )

    @property
    def model(self) -> str | None:
        """The name of the model that clients see; None if the protocol has no models."""
        return str(self.binding.model["name"]) if self.binding.surface.protocol.models else None

    def accept(self, new_connection: NewConnection) -> ConnectionHandler:
        """Check and log a connection. Return its handler. Raises ConnectionRefused, which is logged once per host."""
        self._admission.check(new_connection, self.client_hosts())
        name, wire_log = new_connection.name, self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.surface_number}, host {new_connection.host}")
        return self.create_connection(new_connection, lambda: wire_log.put(name, "-"))

    def create_connection(
        self, new_connection: NewConnection, on_closed: Callable[[], None] = lambda: None, first_bytes: bytes = b""
    ) -> ConnectionHandler:
        """Create a connection that the caller has checked and logged; ``on_closed`` is called when the connection ends.
        ``first_bytes``: bytes of this client that another handler has already answered.
        """
        binding, controller, host = self.binding, self.controller, new_connection.host
        rights = Rights(self.access.is_read_only(host), self.access.may_hibernate or new_connection.hang_up is None)
        log = ClientLog(new_connection.name, controller.wire_log)
        session = binding.surface.session_type(
            binding.model,
            binding.settings,
            self.clock,
            self.shared_state,
            self._saved_state(host) if binding.surface.session_type.inherits_settings else None,
            (lambda: log.log_refusal_once("a setting refused: read only")) if rights.read_only else None,
        )
        activity = controller.presence.add_connection(host, self.surface_number)
        client = CommandProcessor(new_connection, controller, binding, session, activity, rights)
        connection = ClientConnection(
            new_connection,
            client,
            binding,
            self.protocol_watch.start_command_check(new_connection.name, host),
            lambda: self._forget_connection(host, client, connection, on_closed),
            lambda: self._save_state(host, client),
            first_bytes,
        )
        self._clients.add(client)
        self._connections.add(connection)
        return connection

    def client_hosts(self) -> list[str]:
        """Return the host of every client, also of disconnected clients whose operations are still under way."""
        self._clients = {client for client in self._clients if client.is_open or client.has_running_operations}
        return [client.activity.host for client in self._clients]

    def hosts_present(self) -> list[str]:
        """Return the hosts of the clients that are connected, or were within the last ``PRESENCE_TIME`` seconds.
        A client on a serial line counts as connected until ``PRESENCE_TIME`` seconds after its last byte.
        """
        now, connected = self.controller.now(), self.connected_hosts()
        present = [
            connection.host
            for connection in self._connections
            if not connection.is_serial_line or now - connection.last_received_at <= PRESENCE_TIME
        ]
        return present + [host for host in self.just_disconnected_hosts() if host not in connected]

    def connected_hosts(self) -> list[str]:
        return [connection.host for connection in self._connections]

    def just_disconnected_hosts(self) -> list[str]:
        """Return the hosts whose last disconnection was at most ``PRESENCE_TIME`` seconds ago."""
        return [host for host, (at, _) in self._saved_states.items() if self.controller.now() - at <= PRESENCE_TIME]

    def connections(self) -> list[ClientConnection]:
        return [connection for connection in self._connections if not connection.is_stranger]

    def set_address(self, address: str) -> None:
        """Record the address of the port, with its real port number, once the port is open."""
        self._address = address

    def _forget_connection(
        self, host: str, client: CommandProcessor, connection: ClientConnection, on_closed: Callable[[], None]
    ) -> None:
        self._connections.discard(connection)
        on_closed()
        if connection.is_stranger:
            self.controller.presence.forget(client.activity)
            return
        self._save_state(host, client)

    def _saved_state(self, host: str) -> ClientState | None:
        """Return the state of the last connection from this host; None if it closed too long ago."""
        at, state = self._saved_states.get(host, (-1e9, None))
        return state if self.controller.now() - at <= MAX_STATE_AGE else None

    def _save_state(self, host: str, client: CommandProcessor) -> None:
        """Save the state of a client that has disconnected, for the next connection from its host."""
        if client.activity.closed_at is None:
            self.controller.presence.mark_closed(client.activity)
        self._saved_states[host] = (self.controller.now(), copy(client.session.client))
        for old in [key for key, (at, _) in self._saved_states.items() if self.controller.now() - at > MAX_STATE_AGE]:
            del self._saved_states[old]
