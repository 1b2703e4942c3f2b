"""Accepts the connections of a port for every protocol, and hears each until it is known what its program speaks.

For each protocol there is an acceptor, as behind a port of its own; from the decision on what the port feeds is that
acceptor's connection, and nothing is left in between. A program that says nothing for some seconds is spoken to as one
that waits for the first word; its first byte ends that, and decides. Half a command that is not continued within a
second decides nothing. Who may come in, and how many, holds for all of them together.
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

#: Seconds after which a program that has said nothing is spoken to, and after which half a command is given up.
SILENCE, QUIET = 3.0, 1.0
#: Idle bytes that are kept in front of the first command.
MOST_IDLE = 64


class AnyConnection:
    """``left`` is called at its end; the rest is what the acceptors of all protocols are given for it."""

    def __init__(self, port: AnyAcceptor, name: str, host: str, write: Write, left: Callable[[], None]) -> None:
        self._speaking, self._web, self._controller, self._left = port.speaking, port.web, port.controller, left
        self._name, self._host, self._write = name, host, write
        self._hang_up: HangUp | None = None
        self._hand_over: HandOver | None = None
        #: Who answers, and in which protocol; for now only, where that is not decided.
        self._guest: ConnectionHandler | None = None
        self._protocol = ""
        #: What has come and has not been given to anybody.
        self.sent = b""
        #: What was answered before it was decided.
        self._said = b""
        self._heard = -1e9
        #: It waits for the web.
        self._browses = False
        self.feed: Callable[[bytes], None] = self._hear
        self._silence = port.controller.loop.call_later(SILENCE, self._speak_first)

    @property
    def decided(self) -> bool:
        """Whether it is known what is spoken, or at least somebody answers."""
        return self._guest is not None

    @property
    def ended(self) -> bool:
        return self._guest is not None and self._guest.ended

    @property
    def answered(self) -> bool:
        return not self._browses if self._guest is None else self._guest.answered

    def serial(self, change_rate: Callable[[int], int]) -> None:
        """There is no serial port behind it."""

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        self._hang_up, self._hand_over = hang_up, hand_over

    def gone(self) -> None:
        self._silence.cancel()
        if self._guest is not None:
            self._guest.gone()

    def close(self) -> None:
        self._silence.cancel()
        self.feed = lambda data: None
        self._web.leave(self)
        if self._guest is not None:
            self._guest.close()
        self._left()

    # --- who it is --------------------------------------------------------------------------------------------------

    def _speak_first(self) -> None:
        """Nothing has been said: a program that waits for the first word."""
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
        waits = self._guest is not None and PROTOCOLS[self._protocol].waits
        while rest := self.sent.lstrip(IDLE):
            verdict = decide(rest)
            if verdict is None:
                break
            waits = False
            if verdict.protocol == HTTP:
                self._speak_http(rest)
                return
            self._speak(verdict.protocol, verdict.why)
            assert self._guest is not None
            count = undecided(verdict.protocol, rest)
            if not count:
                self._settle()
                return
            common, self.sent = rest[:count], rest[count:]
            self._said += common
            self._guest.feed(common)
        if waits:
            self._part()  # the first byte is not of that protocol, or not yet
        if not rest:
            self.sent = self.sent[-MOST_IDLE:]

    def _speak(self, protocol: str, why: str = "") -> None:
        """Have an acceptor of this protocol answer from now on."""
        if protocol == self._protocol:
            return
        self._part()
        self._protocol = protocol
        self._controller.wire_log.put(self._name, "~", note=", ".join(filter(None, (protocol, why))))
        self._guest = self._speaking[protocol].take(self._name, self._host, self._write, said=self._said)
        if self._hang_up is not None:
            self._guest.network(self._hang_up)

    def _part(self) -> None:
        """Whoever has answered until now does not any more."""
        guest, self._guest, self._protocol = self._guest, None, ""
        if guest is not None:
            guest.close()

    def _settle(self) -> None:
        assert self._guest is not None
        self.feed = self._guest.feed
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
        """Somebody else has the connection from now on. A replay has none."""
        if self._hand_over is not None:
            self._hand_over(take)

    def hang_up(self, last: bytes) -> None:
        """Say this, and that it was the last."""
        if self._hang_up is not None:
            self._hang_up(last)


class AnyAcceptor:
    """``speaking`` are the acceptors by protocol, and ``web`` has what speaks HTTP."""

    #: Each protocol's programs are presented one of their own.
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
        return self.come(name, host, write)

    def admit(self, name: str, host: str) -> None:
        """See whether a connection may be. Raises ConnectionRefused."""
        unknown = sum(not connection.decided for connection in self._connections)
        self._admission.check(name, host, unknown + sum(one.clients() for one in self.speaking.values()))

    def come(self, name: str, host: str, write: Write) -> ConnectionHandler:
        wire_log = self.controller.wire_log
        wire_log.put(name, "+", note=f"surface {self.number}, host {host}")

        def left() -> None:
            self._connections.discard(connection)
            wire_log.put(name, "-")

        connection = AnyConnection(self, name, host, write, left)
        self._connections.add(connection)
        return connection

    def here(self) -> list[str]:
        connected = [host for one in self.speaking.values() for host in one.connected()]
        between = {host for one in self.speaking.values() for host in one.between()}
        return connected + sorted(between.difference(connected))

    def connections(self) -> list[ClientConnection]:
        return [visit for one in self.speaking.values() for visit in one.connections()]

    def located(self, where: str) -> None:
        for one in self.speaking.values():
            one.located(where)
