"""Accepts connections on a port for every protocol, and finds out which protocol each client speaks.

Each protocol has an acceptor, as on a port of its own. Once the protocol is known, that acceptor's connection gets the
received bytes directly. A client that sends nothing for some seconds gets the greeting of the protocol whose clients
wait for one; its first byte then decides the protocol. An incomplete command that is not continued within a second is
dropped. Access rules and the maximum number of clients apply to all protocols together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import ClientAdmission
from gateway.clients.any_protocol.deciding import HTTP_PROTOCOL, decide, protocol_that_waits, shared_prefix
from gateway.clients.connection import ClientConnection
from gateway.clients.strangers import IDLE_BYTES
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.handler import Connected, ConnectionHandler
from gateway.transport.web_server import NO_PAGE_RESPONSE, WebServer, answer_of

#: Seconds after which a silent client gets a greeting, and after which an incomplete command is dropped.
GREETING_DELAY, INCOMPLETE_TIMEOUT = 3.0, 1.0
#: The maximum number of idle bytes stored before the first command.
MAX_IDLE_BYTES = 64


class AnyConnection:
    """A connection to a port for every protocol, which it recognises. ``closed`` is called at its end."""

    def __init__(self, port: AnyAcceptor, connected: Connected, closed: Callable[[], None]) -> None:
        self._acceptors, self._web, self._controller, self._closed = port.acceptors, port.web, port.controller, closed
        self._transport, self.host = connected, connected.host
        #: The handler that answers this connection, and its protocol; both may change until the protocol is confirmed.
        self._handler: ConnectionHandler | None = None
        self._protocol = ""
        #: Received bytes that were not yet passed to a handler.
        self.undelivered = b""
        #: Bytes that were answered before the protocol was confirmed.
        self._answered_bytes = b""
        self._last_received = -1e9
        self.feed: Callable[[bytes], None] = self._recognise
        self._greeting_timer = port.controller.loop.call_later(GREETING_DELAY, self._greet)

    @property
    def decided(self) -> bool:
        """Whether a protocol is assumed or confirmed."""
        return self._handler is not None

    @property
    def answered(self) -> bool:
        return self._handler is None or self._handler.answered

    def peer_closed(self) -> None:
        self._greeting_timer.cancel()
        if self._handler is not None:
            self._handler.peer_closed()

    def close(self) -> None:
        self._greeting_timer.cancel()
        self.feed = lambda data: None
        if self._handler is not None:
            self._handler.close()
        self._closed()

    # --- recognising the protocol -----------------------------------------------------------------------------------

    def _greet(self) -> None:
        """Answer a silent client in the protocol whose clients wait for a greeting."""
        protocol = protocol_that_waits()
        if protocol is not None:
            self._answer_in(protocol, f"because the program has sent nothing for {GREETING_DELAY:g} s")

    def _recognise(self, data: bytes) -> None:
        self._greeting_timer.cancel()
        now = self._controller.now()
        if now - self._last_received >= INCOMPLETE_TIMEOUT and (half := self.undelivered.lstrip(IDLE_BYTES)):
            self._controller.wire_log.put(
                self._transport.name, "x", half, "an incomplete command that was not continued within a second"
            )
            self.undelivered = b""
        self._last_received = now
        self.undelivered += data
        waits = self._handler is not None and PROTOCOLS[self._protocol].mount_speaks_first
        while rest := self.undelivered.lstrip(IDLE_BYTES):
            verdict = decide(rest)
            if verdict is None:
                break
            waits = False
            if verdict.protocol == HTTP_PROTOCOL:
                self._pass_to_web(rest)
                return
            self._answer_in(verdict.protocol, verdict.reason)
            assert self._handler is not None
            count = shared_prefix(verdict.protocol, rest)
            if not count:
                self._decide()
                return
            common, self.undelivered = rest[:count], rest[count:]
            self._answered_bytes += common
            self._handler.feed(common)
        if waits:
            self._close_handler()  # the first byte does not decide for that protocol
        if not rest:
            self.undelivered = self.undelivered[-MAX_IDLE_BYTES:]

    def _answer_in(self, protocol: str, reason: str = "") -> None:
        """Let the acceptor of this protocol answer from now on."""
        if protocol == self._protocol:
            return
        self._close_handler()
        self._protocol = protocol
        self._controller.wire_log.put(self._transport.name, "~", note=", ".join(filter(None, (protocol, reason))))
        self._handler = self._acceptors[protocol].create_silently(self._transport, first_bytes=self._answered_bytes)

    def _close_handler(self) -> None:
        """Close the handler that has answered until now."""
        handler, self._handler, self._protocol = self._handler, None, ""
        if handler is not None:
            handler.close()

    def _decide(self) -> None:
        assert self._handler is not None
        self.feed = self._handler.feed
        sent, self.undelivered = self.undelivered, b""
        self.feed(sent)

    def _pass_to_web(self, received: bytes) -> None:
        self._close_handler()
        text = "speaks HTTP: passed to the console, nothing of it reaches the mount"
        self._controller.wire_log.note_once(self._transport.name, text, key=self.host)
        if self._transport.hand_over is not None:
            self._transport.hand_over(lambda transport: self._web.take(transport, received))
        elif self._transport.hang_up is not None:
            self._transport.hang_up(answer_of(*NO_PAGE_RESPONSE))


class AnyAcceptor:
    """Accepts the connections of one port. ``acceptors``: the acceptors by protocol; ``web`` takes HTTP connections."""

    #: None, because each protocol presents a model of its own.
    model: str | None = None

    def __init__(self, acceptors: Mapping[str, ConnectionAcceptor], web: WebServer) -> None:
        self.acceptors, self.web = acceptors, web
        first = next(iter(acceptors.values()))
        self.controller, self.number, self.access = first.controller, first.number, first.access
        self._admission = ClientAdmission(self.access, self.number, self.controller.wire_log)
        self._connections: set[AnyConnection] = set()

    def accept(self, connected: Connected) -> ConnectionHandler:
        """Check, log and create a new connection. Raises ConnectionRefused."""
        hosts = [other.host for other in self._connections if not other.decided]
        for acceptor in self.acceptors.values():
            hosts += acceptor.clients()
        self._admission.check(connected, hosts)
        wire_log = self.controller.wire_log
        wire_log.put(connected.name, "+", note=f"surface {self.number}, host {connected.host}")

        def closed() -> None:
            self._connections.discard(connection)
            wire_log.put(connected.name, "-")

        connection = AnyConnection(self, connected, closed)
        self._connections.add(connection)
        return connection

    def present_hosts(self) -> list[str]:
        connected = [host for acceptor in self.acceptors.values() for host in acceptor.connected_hosts()]
        between = {host for acceptor in self.acceptors.values() for host in acceptor.reconnecting_hosts()}
        return connected + sorted(between.difference(connected))

    def connections(self) -> list[ClientConnection]:
        return [connection for acceptor in self.acceptors.values() for connection in acceptor.connections()]

    def set_address(self, where: str) -> None:
        for acceptor in self.acceptors.values():
            acceptor.set_address(where)
