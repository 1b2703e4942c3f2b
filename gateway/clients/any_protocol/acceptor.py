"""Accepts connections on a port for every protocol, and finds out which protocol each client speaks.

Each protocol has an acceptor, like behind a port of its own. Once the protocol is known, the port feeds that acceptor's
connection directly. A client that sends nothing for some seconds gets the greeting of the protocol whose clients wait
for one; its first byte ends that and decides. An incomplete command that is not continued within a second decides
nothing. Access rules and the maximum number of clients apply to all protocols together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.clients.acceptor import ConnectionAcceptor
from gateway.clients.access import Admission
from gateway.clients.any_protocol.deciding import HTTP, decide, undecided, waiting
from gateway.clients.any_protocol.web import Web
from gateway.clients.connection import ClientConnection
from gateway.clients.strangers import IDLE
from gateway.protocols.registry import PROTOCOLS
from gateway.transport.handler import ConnectionHandler, HandOver, HangUp, Taker, Write

#: Seconds after which a silent client gets a greeting, and after which an incomplete command is dropped.
SILENCE, QUIET = 3.0, 1.0
#: Idle bytes that are kept before the first command.
MOST_IDLE = 64


class AnyConnection:
    """A connection to such a port. ``left`` is called at its end; the other arguments are those of an acceptor."""

    def __init__(self, port: AnyAcceptor, name: str, host: str, write: Write, left: Callable[[], None]) -> None:
        self._speaking, self._web, self._controller, self._left = port.speaking, port.web, port.controller, left
        self._name, self._host, self._write = name, host, write
        self._hang_up: HangUp | None = None
        self._hand_over: HandOver | None = None
        #: The connection that answers, and its protocol; preliminary while the protocol is undecided.
        self._handler: ConnectionHandler | None = None
        self._protocol = ""
        #: Received bytes that no connection has got yet.
        self.sent = b""
        #: Bytes that were answered before the decision.
        self._said = b""
        self._heard = -1e9
        #: Whether it waits for the web server.
        self._browses = False
        self.feed: Callable[[bytes], None] = self._hear
        self._silence = port.controller.loop.call_later(SILENCE, self._speak_first)

    @property
    def decided(self) -> bool:
        """Whether the protocol is known, at least preliminarily."""
        return self._handler is not None

    @property
    def ended(self) -> bool:
        return self._handler is not None and self._handler.ended

    @property
    def answered(self) -> bool:
        return not self._browses if self._handler is None else self._handler.answered

    def serial(self, change_rate: Callable[[int], int]) -> None:
        """Do nothing: there is no serial port."""

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        self._hang_up, self._hand_over = hang_up, hand_over

    def peer_closed(self) -> None:
        self._silence.cancel()
        if self._handler is not None:
            self._handler.peer_closed()

    def close(self) -> None:
        self._silence.cancel()
        self.feed = lambda data: None
        self._web.leave(self)
        if self._handler is not None:
            self._handler.close()
        self._left()

    # --- recognising the protocol -----------------------------------------------------------------------------------

    def _speak_first(self) -> None:
        """Answer a silent client in the protocol whose clients wait for a greeting."""
        protocol = waiting()
        if protocol is not None:
            self._speak(protocol, f"because the program has said nothing for {SILENCE:g} s")

    def _hear(self, data: bytes) -> None:
        self._silence.cancel()
        now = self._controller.now()
        if now - self._heard >= QUIET and (half := self.sent.lstrip(IDLE)):
            self._controller.wire_log.put(self._name, "x", half, "half a command, whose rest did not come in a second")
            self.sent = b""
        self._heard = now
        self.sent += data
        waits = self._handler is not None and PROTOCOLS[self._protocol].waits
        while rest := self.sent.lstrip(IDLE):
            verdict = decide(rest)
            if verdict is None:
                break
            waits = False
            if verdict.protocol == HTTP:
                self._speak_http(rest)
                return
            self._speak(verdict.protocol, verdict.why)
            assert self._handler is not None
            count = undecided(verdict.protocol, rest)
            if not count:
                self._settle()
                return
            common, self.sent = rest[:count], rest[count:]
            self._said += common
            self._handler.feed(common)
        if waits:
            self._part()  # the first byte does not decide for that protocol
        if not rest:
            self.sent = self.sent[-MOST_IDLE:]

    def _speak(self, protocol: str, why: str = "") -> None:
        """Let the acceptor of this protocol answer from now on."""
        if protocol == self._protocol:
            return
        self._part()
        self._protocol = protocol
        self._controller.wire_log.put(self._name, "~", note=", ".join(filter(None, (protocol, why))))
        self._handler = self._speaking[protocol].create_silently(self._name, self._host, self._write, said=self._said)
        if self._hang_up is not None:
            self._handler.network(self._hang_up)

    def _part(self) -> None:
        """Close the connection that has answered until now."""
        handler, self._handler, self._protocol = self._handler, None, ""
        if handler is not None:
            handler.close()

    def _settle(self) -> None:
        assert self._handler is not None
        self.feed = self._handler.feed
        sent, self.sent = self.sent, b""
        self.feed(sent)

    # --- the web ----------------------------------------------------------------------------------------------------

    def _speak_http(self, sent: bytes) -> None:
        self._part()
        self.sent, self.feed, self._browses = sent, self._wait_for_web, True
        words = "speaks HTTP: for the console, the mount hears nothing of it"
        self._controller.wire_log.note_once(self._name, words, of=self._host)
        self._web.enter(self)

    def _wait_for_web(self, data: bytes) -> None:
        self.sent += data
        self._web.more(self)

    def hand_over(self, take: Taker) -> None:
        """Give the connection to another owner. In a replay there is none to give."""
        if self._hand_over is not None:
            self._hand_over(take)

    def hang_up(self, last: bytes) -> None:
        """Send the last bytes and close the connection."""
        if self._hang_up is not None:
            self._hang_up(last)


class AnyAcceptor:
    """Accepts the connections of one port. ``speaking``: the acceptors by protocol; ``web`` takes HTTP connections."""

    #: None, because each protocol presents a model of its own.
    model: str | None = None

    def __init__(self, speaking: Mapping[str, ConnectionAcceptor], web: Web) -> None:
        self.speaking, self.web = speaking, web
        first = next(iter(speaking.values()))
        self.controller, self.number, self.access = first.controller, first.number, first.access
        self._admission = Admission(self.access, self.number, self.controller.wire_log)
        self._connections: set[AnyConnection] = set()

    def arrive(self, name: str, host: str, write: Write) -> ConnectionHandler:
        """A new connection. Raises ConnectionRefused."""
        self.admit(name, host)
        return self.create(name, host, write)

    def admit(self, name: str, host: str) -> None:
        """Check whether a connection is allowed. Raises ConnectionRefused."""
        unknown = sum(not connection.decided for connection in self._connections)
        self._admission.check(name, host, unknown + sum(one.clients() for one in self.speaking.values()))

    def create(self, name: str, host: str, write: Write) -> ConnectionHandler:
        wire_log = self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.number}, host {host}")

        def left() -> None:
            self._connections.discard(connection)
            wire_log.put(name, "-")

        connection = AnyConnection(self, name, host, write, left)
        self._connections.add(connection)
        return connection

    def present_hosts(self) -> list[str]:
        connected = [host for one in self.speaking.values() for host in one.connected_hosts()]
        between = {host for one in self.speaking.values() for host in one.reconnecting_hosts()}
        return connected + sorted(between.difference(connected))

    def connections(self) -> list[ClientConnection]:
        return [connection for one in self.speaking.values() for connection in one.connections()]

    def set_address(self, where: str) -> None:
        for one in self.speaking.values():
            one.set_address(where)
