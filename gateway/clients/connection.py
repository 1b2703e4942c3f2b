"""One client connection: recognises the client, lets its bytes in when it is their turn, and cleans up at its end.

On network ports anyone may connect. A web browser or port scanner is recognised by its first bytes and disconnected
before anything it sent is processed.

A connection with more bytes to read than one read takes is behind. When they were sent is unknown, so they begin no
motion if a stop came after the connection fell behind. After a second behind, the client may be gone, so nothing in the
backlog begins a motion. The connection has caught up when a read leaves nothing; after having been late, when that has
been so for a second.
"""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from gateway.clients.access import Rights
from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.commands.turn import LONG_AGO
from gateway.clients.profiles import ClientProfile, SurfaceBinding
from gateway.clients.strangers import Beginning, Greeting, Piece, page
from gateway.clients.wrong_preset import FirstWords
from gateway.transport.baud import BaudTrial
from gateway.transport.handler import HandOver, HangUp
from gateway.transport.intake import LATE, SHARE

#: Logged when a connection ends and its first bytes were neither a command nor recognised.
HALF_A_WORD = "no command of this surface's protocol begins so"
#: Bytes of one connection that may wait for their turn.
PATIENCE = 512
#: Seconds without data after which a connection that was behind has caught up.
CAUGHT_UP = 5.0


class Backlog:
    """Whether a connection is behind; times are those of the event loop, seconds. ``late``: for more than a second."""

    def __init__(self) -> None:
        self.late = False
        #: The number of stops when it fell behind; None while it is not behind.
        self._stops: int | None = None
        self._since = self._last = -1e9

    def sent(self, now: float) -> int | None:
        """Return how many stops there were when the next bytes may have been sent; None if they were sent just now."""
        if self._stops is not None and now - self._last > (LATE if self.late else CAUGHT_UP):
            self._stops, self.late = None, False
        self.late = self.late or (self._stops is not None and now - self._since > LATE)
        return LONG_AGO if self.late else self._stops

    def took(self, size: int, now: float, stops: int) -> None:
        """Record that ``size`` bytes were read at ``now``, after ``stops`` stops."""
        if size >= SHARE:
            if self._stops is None:
                self._stops, self._since = stops, now
            self._last = now
        elif not self.late:
            self._stops = None


class ClientConnection:
    """A client's connection: from its first bytes, which tell who it is, to its end.

    ``lasting``: a serial line, whose clients do not visibly connect or disconnect. ``heard``: the loop time of its last
    bytes. ``rights``: those of a client on the network. If many connections are active it waits for its turn, unless
    its bytes may end a motion.
    """

    def __init__(
        self,
        client: CommandProcessor,
        face: SurfaceBinding,
        first: FirstWords,
        left: Callable[[], None],
        handed_on: Callable[[], None],
        lasting: bool,
        rights: Rights,
    ) -> None:
        self.client, self._manners, self._left, self.lasting = client, face.manners, left, lasting
        self._handed_on = handed_on
        self._first: FirstWords | None = first
        self._screen: Beginning | None = None
        self._face, self._rights = face, rights
        self._controller, self._wanted = client.controller, client.controller.wanted
        #: The client program that was recognised.
        self.profile = ""
        #: Whether it is no telescope program.
        self.stranger = False
        self._hang_up: HangUp = lambda last: None
        #: When the bytes that are being processed arrived, if that was earlier.
        self._came: float | None = None
        self.host, self.heard = client.life.who, -1e9
        #: The first bytes, as long as the client program may be recognised by them.
        self.said = b""
        #: Bytes that wait for their turn, each with the number of stops when they arrived.
        self._waiting: list[tuple[bytes, int]] = []
        self._backlog = Backlog()
        #: Whether its lateness was logged; whether the other end has closed.
        self._said_late = self._gone = False
        self._take = self._on_line if lasting else self._listen if face.manners else client.feed

    @property
    def protocol(self) -> str:
        return self._face.surface.protocol.name

    @property
    def ended(self) -> bool:
        """Whether the last bytes only ended motions and need no reply."""
        return self.client.ended and not self._waiting

    @property
    def answered(self) -> bool:
        """Whether all commands were answered that are answered at all."""
        return not self._waiting and self.client.answered

    def feed(self, data: bytes) -> None:
        if self._first is not None:
            self._first.hear(data)
            self._first = None if self._first.over else self._first
        now, was_late = self._controller.now(), self._backlog.late
        sent = self._backlog.sent(now)
        if self._backlog.late:
            self._come_late()
        elif was_late and not self._gone:
            self.client.life.closed = None  # it has caught up, so a client is there
        self._feed(data, sent)
        self._backlog.took(len(data), now, self._wanted.value.stops)

    def _come_late(self) -> None:
        """The sender may have disconnected, so the motions it started are no longer held by it."""
        if self.client.life.closed is None:
            self._controller.presence.leave(self.client.life)
        if not self._said_late:
            self._said_late = True
            self.client.log.note(
                "sends faster than its commands can be carried out: they are too old "
                "to begin a motion until it has caught up"
            )

    def peer_closed(self) -> None:
        """The other end has closed: from now on the client has a limited time to reconnect."""
        self._gone = True
        if not self.stranger:
            self._handed_on()

    def _feed(self, data: bytes, behind: int | None) -> None:
        """Process bytes now or in their turn; ``behind`` is the number of stops when they may have been sent."""
        urgent = self._face.surface.protocol.may_end_motion(data)
        piled_up = sum(len(piece) for piece, _ in self._waiting) + len(data) > PATIENCE
        if urgent or (self._waiting and piled_up) or (not self._waiting and self._controller.fair_scheduler.open()):
            self._go_on()
            self._take(data, behind)
            return
        self._waiting.append((data, self._wanted.value.stops if behind is None else behind))
        if len(self._waiting) == 1:
            self._controller.fair_scheduler.enter(self._go_on)

    def _go_on(self) -> None:
        """Process all waiting bytes in the order of arrival."""
        waiting, self._waiting = self._waiting, []
        for data, stops in waiting:
            self._take(data, stops)

    def _on_line(self, data: bytes, stops: int | None) -> None:
        """Feed the client of a serial line, and remember when it was last heard."""
        self.heard = self._controller.now()
        self.client.feed(data, stops)

    def _listen(self, data: bytes, stops: int | None) -> None:
        """Feed the client, and compare its first bytes with the known client programs."""
        if self._manners:
            self.said += data
            self._manners = tuple(manner for manner in self._manners if self._may_be(manner))
        self.client.feed(data, stops)

    def _may_be(self, manner: ClientProfile) -> bool:
        """Whether more bytes are needed to decide about a profile; if it fits, apply it."""
        if not self.said.startswith(manner.first):
            return manner.first.startswith(self.said)
        client, session = self.client, self.client.session
        client.runner.equinox = manner.equinox or client.runner.equinox
        session.settings = replace(session.settings, **manner.settings)
        session.kept.precision = manner.settings.get("precision", session.kept.precision)
        self.profile = manner.program
        client.log.note(f"recognised client {manner.program}: applying its profile")
        return False

    def serial(self, change_rate: Callable[[int], int]) -> None:
        self.client.rate = BaudTrial(change_rate)

    def network(self, hang_up: HangUp, hand_over: HandOver | None = None) -> None:
        """Mark the connection as one from the network: the first bytes are checked before any is processed."""
        client, now = self.client, self._controller.now
        self._hang_up, self._after = hang_up, self._take
        self._screen = Beginning(self._face.beginning, self._face.surface.protocol.name)
        client.runner.rights = self._rights
        client.came = lambda: now() if self._came is None else self._came
        self._take = self._screened

    def _screened(self, data: bytes, stops: int | None) -> None:
        """Feed the bytes that cannot be a stranger's, with their time of arrival; disconnect a stranger."""
        now = self._controller.now()
        assert self._screen is not None
        pieces = self._screen.hear(Piece(data, now, self._controller.stops if stops is None else stops))
        if self._screen.stranger is not None:
            self._turn_away(self._screen.stranger)
            return
        if self._screen.over:
            self._take = self._after
        for piece in pieces:
            late = piece.at != now
            self._came = piece.at if late else None
            self._after(piece.data, piece.stops if late else stops)
        self._came = None

    def _turn_away(self, greeting: Greeting) -> None:
        """Log what the stranger sent, and close the connection."""
        self.stranger, self._take = True, lambda data, stops: None
        if self._first is not None:
            self._first.over = True
        speaks, client = self._face.speaks, self.client
        client.log.note(
            f"sends {greeting.words}; this is a port for programs that speak {speaks}: "
            "nothing of it reaches the mount, and the connection is closed"
        )
        self._hang_up(page(speaks, greeting.head_only) if greeting.http else b"")

    def close(self) -> None:
        self._go_on()
        if self._screen is not None and not self.stranger and self._screen.waiting:
            self.client.log.put("x", self._screen.waiting, HALF_A_WORD)
        self.client.close()
        self._left()
