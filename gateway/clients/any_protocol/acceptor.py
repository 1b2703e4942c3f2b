"""Accepts connections on a port for every protocol, and finds out which protocol each client speaks.

Each protocol has an acceptor, as on a port of its own. Once the protocol is known, that acceptor's connection gets the
received bytes directly. A client that sends nothing for some seconds gets the greeting of the protocol whose clients
wait for one; the client's first byte then decides. An incomplete command that is not continued within a second is
dropped. Access rules and the maximum number of clients apply to all protocols together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import ClientAdmission
from gateway.clients.any_protocol.deciding import HTTP_PROTOCOL, find_protocol, greeting_protocol, shared_prefix_length
from gateway.clients.connection import ClientConnection
from gateway.clients.strangers import IDLE_BYTES
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.handler import ConnectionHandler, NewConnection
from gateway.transport.web_server import NO_PAGE_RESPONSE, WebServer, response_bytes

#: Seconds after which a silent client gets a greeting, and after which an incomplete command is dropped.
GREETING_DELAY, INCOMPLETE_TIMEOUT = 3.0, 1.0
#: The maximum number of stored bytes that belong to no command and precede a client's first command.
MAX_IDLE_BYTES = 64


class AnyProtocolConnection:
    """A connection to a port for every protocol; finds out the client's protocol. Calls ``on_end`` when it ends."""

    def __init__(self, port: AnyProtocolAcceptor, connection: NewConnection, on_end: Callable[[], None]) -> None:
        self._acceptors, self._web, self._controller, self._on_end = (port.acceptors, port.web, port.controller, on_end)
        self._connection, self.host = connection, connection.host
        #: The handler that answers this connection, and its protocol; both may change until the protocol is confirmed.
        self._handler: ConnectionHandler | None = None
        self._protocol = ""
        #: Received bytes that were not yet passed to a handler.
        self.undelivered_bytes = b""
        #: Bytes that were answered before the protocol was confirmed.
        self._answered_bytes = b""
        self._last_received_at = -1e9
        self.feed: Callable[[bytes], None] = self._recognise
        self._greeting_timer = port.controller.loop.call_later(GREETING_DELAY, self._greet)

    @property
    def has_protocol(self) -> bool:
        """Whether a protocol is assumed or confirmed."""
        return self._handler is not None

    @property
    def all_answered(self) -> bool:
        return self._handler is None or self._handler.all_answered

    def peer_closed(self) -> None:
        self._greeting_timer.cancel()
        if self._handler is not None:
            self._handler.peer_closed()

    def close(self) -> None:
        self._greeting_timer.cancel()
        self.feed = lambda data: None
        if self._handler is not None:
            self._handler.close()
        self._on_end()

    # --- recognising the protocol -----------------------------------------------------------------------------------

    def _greet(self) -> None:
        """Answer a silent client in the protocol whose clients wait for a greeting."""
        protocol = greeting_protocol()
        if protocol is not None:
            self._switch_protocol(protocol, f"because the program has sent nothing for {GREETING_DELAY:g} s")

    def _recognise(self, data: bytes) -> None:
        self._greeting_timer.cancel()
        now = self._controller.now()
        if now - self._last_received_at >= INCOMPLETE_TIMEOUT and (half := self.undelivered_bytes.lstrip(IDLE_BYTES)):
            self._controller.wire_log.put(
                self._connection.name, "x", half, "an incomplete command that was not continued within a second"
            )
            self.undelivered_bytes = b""
        self._last_received_at = now
        self.undelivered_bytes += data
        awaits_first_byte = self._handler is not None and PROTOCOLS[self._protocol].mount_speaks_first
        while received := self.undelivered_bytes.lstrip(IDLE_BYTES):
            verdict = find_protocol(received)
            if verdict is None:
                break
            awaits_first_byte = False
            if verdict.protocol == HTTP_PROTOCOL:
                self._pass_to_web(received)
                return
            self._switch_protocol(verdict.protocol, verdict.reason)
            assert self._handler is not None
            count = shared_prefix_length(verdict.protocol, received)
            if not count:
                self._confirm_protocol()
                return
            common, self.undelivered_bytes = received[:count], received[count:]
            self._answered_bytes += common
            self._handler.feed(common)
        if awaits_first_byte:
            self._close_handler()  # the first byte does not decide for that protocol
        if not received:
            self.undelivered_bytes = self.undelivered_bytes[-MAX_IDLE_BYTES:]

    def _switch_protocol(self, protocol: str, reason: str = "") -> None:
        """Let the acceptor of this protocol answer from now on."""
        if protocol == self._protocol:
            return
        self._close_handler()
        self._protocol = protocol
        self._controller.wire_log.put(self._connection.name, "~", note=", ".join(filter(None, (protocol, reason))))
        self._handler = self._acceptors[protocol].create_connection(self._connection, first_bytes=self._answered_bytes)

    def _close_handler(self) -> None:
        """Close the handler that has answered until now."""
        handler, self._handler, self._protocol = self._handler, None, ""
        if handler is not None:
            handler.close()

    def _confirm_protocol(self) -> None:
        assert self._handler is not None
        self.feed = self._handler.feed
        sent, self.undelivered_bytes = self.undelivered_bytes, b""
        self.feed(sent)

    def _pass_to_web(self, received: bytes) -> None:
        self._close_handler()
        text = "speaks HTTP: passed to the console, nothing of it reaches the mount"
        self._controller.wire_log.note_once(self._connection.name, text, key=self.host)
        if self._connection.hand_over is not None:
            self._connection.hand_over(lambda transport: self._web.take_over(transport, received))
        elif self._connection.hang_up is not None:
            self._connection.hang_up(response_bytes(*NO_PAGE_RESPONSE))


class AnyProtocolAcceptor:
    """Accepts the connections of one port. ``acceptors``: the acceptors by protocol; ``web`` takes HTTP connections."""

    #: The port as a whole has no model, because each protocol presents a model of its own.
    model: str | None = None

    def __init__(self, acceptors: Mapping[str, ConnectionAcceptor], web: WebServer) -> None:
        self.acceptors, self.web = acceptors, web
        first = next(iter(acceptors.values()))
        self.controller, self.surface_number, self.access = first.controller, first.surface_number, first.access
        self._admission = ClientAdmission(self.access, self.surface_number, self.controller.wire_log)
        self._connections: set[AnyProtocolConnection] = set()

    def accept(self, new_connection: NewConnection) -> ConnectionHandler:
        """Check, log and create a new connection. Raises ConnectionRefused."""
        hosts = [other.host for other in self._connections if not other.has_protocol]
        for acceptor in self.acceptors.values():
            hosts += acceptor.client_hosts()
        self._admission.check(new_connection, hosts)
        wire_log = self.controller.wire_log
        wire_log.put(new_connection.name, "+", note=f"surface {self.surface_number}, host {new_connection.host}")

        def closed() -> None:
            self._connections.discard(connection)
            wire_log.put(new_connection.name, "-")

        connection = AnyProtocolConnection(self, new_connection, closed)
        self._connections.add(connection)
        return connection

    def hosts_present(self) -> list[str]:
        connected = [host for acceptor in self.acceptors.values() for host in acceptor.connected_hosts()]
        between = {host for acceptor in self.acceptors.values() for host in acceptor.just_disconnected_hosts()}
        return connected + sorted(between.difference(connected))

    def connections(self) -> list[ClientConnection]:
        return [connection for acceptor in self.acceptors.values() for connection in acceptor.connections()]

    def set_address(self, address: str) -> None:
        for acceptor in self.acceptors.values():
            acceptor.set_address(address)
