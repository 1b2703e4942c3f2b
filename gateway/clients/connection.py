"""One connection of a program: who it may turn out to be, when its bytes have their turn, and how it ends.

From a network comes who likes: there a web browser or a port scanner is recognised by its first bytes and turned away
before anything of it is heard.

A connection that sends more than is read at a time is behind. Nobody knows when the rest was sent, so what may be older
than a stop begins no motion after that stop. One that has been behind for over a second may be closed at the other end:
nothing that is left of it begins a motion. It has caught up when nothing was left to read, or, after having been late,
when that has been so for a second.
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

#: Why the first bytes of a connection were dropped when it ended before it was known who had sent them.
HALF_A_WORD = "no command of this surface's protocol begins so"
#: Bytes that may wait for their turn, of one connection.
PATIENCE = 512
#: Seconds after which whoever has sent a whole share, and nothing since, has caught up.
CAUGHT_UP = 5.0


class Backlog:
    """Of one connection; times are seconds of the event loop's clock. ``late``: what is read now was sent long ago."""

    def __init__(self) -> None:
        self.late = False
        #: How many stops there had been when it fell behind; None while it is not.
        self._stops: int | None = None
        self._since = self._last = -1e9

    def sent(self, now: float) -> int | None:
        """How many stops there may have been when that was sent which is about to be taken in; None for all so far."""
        if self._stops is not None and now - self._last > (LATE if self.late else CAUGHT_UP):
            self._stops, self.late = None, False
        self.late = self.late or (self._stops is not None and now - self._since > LATE)
        return LONG_AGO if self.late else self._stops

    def took(self, size: int, now: float, stops: int) -> None:
        """So many bytes were taken in; there have been so many stops now."""
        if size >= SHARE:
            if self._stops is None:
                self._stops, self._since = stops, now
            self._last = now
        elif not self.late:
            self._stops = None


class ClientConnection:
    """A client together with who it may turn out to be, and what is to be done when it leaves.

    ``lasting``: it is a serial line, where nobody is seen to come or go; ``heard`` is the loop time of its last bytes.
    ``rights`` are those of a client that comes over a network.
    Where many come in at once it waits for its turn, unless it may have come to end a motion.
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
        #: The program that it was recognised as.
        self.profile = ""
        #: Whether it has turned out to be no program for telescopes.
        self.stranger = False
        self._hang_up: HangUp = lambda last: None
        #: When the bytes that are being fed came, where that was before now.
        self._came: float | None = None
        self.host, self.heard = client.life.who, -1e9
        #: What it has said, as long as its program may be told by that.
        self.said = b""
        #: What waits for its turn: bytes, and how many stops there had been when they came.
        self._waiting: list[tuple[bytes, int]] = []
        self._backlog = Backlog()
        #: It was said that it is late; the other side has closed.
        self._said_late = self._gone = False
        self._take = self._on_line if lasting else self._listen if face.manners else client.feed

    @property
    def protocol(self) -> str:
        return self._face.surface.protocol.name

    @property
    def ended(self) -> bool:
        """Whether the last bytes did nothing but end motions without a reply."""
        return self.client.ended and not self._waiting

    @property
    def answered(self) -> bool:
        """Whether everything that was fed has been answered, as far as it is answered at all."""
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
            self.client.life.closed = None  # it has caught up, so somebody is there
        self._feed(data, sent)
        self._backlog.took(len(data), now, self._wanted.value.stops)

    def _come_late(self) -> None:
        """Nobody knows whether who sent this is still there: it holds no arrow."""
        if self.client.life.closed is None:
            self._controller.presence.leave(self.client.life)
        if not self._said_late:
            self._said_late = True
            self.client.log.note(
                "has sent so much that it is read too late: nothing of it "
                "sets the mount moving before all of it was read"
            )

    def gone(self) -> None:
        """The other side has closed its end: its time begins in which it may come back."""
        self._gone = True
        if not self.stranger:
            self._handed_on()

    def _feed(self, data: bytes, behind: int | None) -> None:
        """Take bytes in at once or in their turn; ``behind`` is how many stops there were when they may have come."""
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
        """Everything that waits, in the order in which it came."""
        waiting, self._waiting = self._waiting, []
        for data, stops in waiting:
            self._take(data, stops)

    def _on_line(self, data: bytes, stops: int | None) -> None:
        """Feed the client, and remember that somebody is there."""
        self.heard = self._controller.now()
        self.client.feed(data, stops)

    def _listen(self, data: bytes, stops: int | None) -> None:
        """Feed the client, and look at what it says as long as it may be one that is known."""
        if self._manners:
            self.said += data
            self._manners = tuple(manner for manner in self._manners if self._may_be(manner))
        self.client.feed(data, stops)

    def _may_be(self, manner: ClientProfile) -> bool:
        """Whether more must be heard; when enough was heard the client is treated so from here on."""
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
        """From here on nothing is heard before it is known that no stranger says it."""
        client, now = self.client, self._controller.now
        self._hang_up, self._after = hang_up, self._take
        self._screen = Beginning(self._face.beginning, self._face.surface.protocol.name)
        client.runner.rights = self._rights
        client.came = lambda: now() if self._came is None else self._came
        self._take = self._screened

    def _screened(self, data: bytes, stops: int | None) -> None:
        """Feed what cannot be a stranger's, as of when it came; turn a stranger away."""
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
        """Say once what came, and end the connection."""
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
