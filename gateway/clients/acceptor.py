"""Who comes in: sessions for connections.

A session is a connection. A new one begins with a copy of the state of that connection from the same host which closed
last, if that was within a minute: programs that open a connection for every command keep their target that way, and two
programs connected at the same time do not disturb each other. From a network comes who likes: there a web browser or a
port scanner is recognised by its first bytes and turned away before anything of it is heard.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from gateway.clients.access import MOST_HOSTS, Access, Rights
from gateway.clients.backlog import Backlog
from gateway.clients.command_processor import CommandProcessor
from gateway.clients.equinox import Equinox
from gateway.clients.greeting import Beginning, Piece
from gateway.clients.strangers import Greeting, page
from gateway.clients.wrong_preset import FirstWords, Presets
from gateway.mount.controller import MountController
from gateway.protocols.base.frames import Framing
from gateway.protocols.base.read_only import Sealed
from gateway.protocols.base.surface import Session, Surface
from gateway.system.file_limits import scarce
from gateway.transport import ConnectionHandler
from gateway.transport.baud_trial import BaudTrial
from gateway.transport.handler import ConnectionRefused, HangUp

INHERIT_FOR = 60.0
#: A program on a serial line, or one that opens a connection for every command, is here so long after it was heard.
HERE = 10.0
#: Why the first bytes of a connection were dropped when it ended before it was known who had sent them.
HALF_A_WORD = "no command of this surface's protocol begins so"
#: Bytes that may wait for their turn, of one connection.
PATIENCE = 512


class ClientProfile(Struct, frozen=True):
    """How a connection that begins with the bytes ``first`` is treated, because only one program begins so."""

    first: bytes
    program: str
    settings: dict[str, Any]
    equinox: Equinox | None


class SurfaceBinding(Struct, frozen=True):
    """A surface as it is presented on one port."""

    #: The protocol's name where a person reads it.
    speaks: str
    surface: Surface
    framing: Callable[[Callable[[], float]], Framing]
    #: What a program may begin with, for ``Beginning``.
    beginning: re.Pattern[bytes]
    model: dict[str, Any]
    settings: dict[str, Any]
    equinox: Equinox | None = None
    #: What its programs count in where the user says nothing: ``jnow`` or ``j2000``.
    counts_in: str = "jnow"
    #: Whether the mount is equatorial, whether it is German, whether it has a GPS receiver -> the model to present;
    #: None where the user has named one.
    fit: Callable[[bool, bool | None, bool], dict[str, Any]] | None = None
    manners: tuple[ClientProfile, ...] = ()


class ConnectionAcceptor:
    """Makes a client for every connection of one port."""

    def __init__(
        self,
        controller: MountController,
        face: SurfaceBinding,
        shared: dict[str, Any],
        host_clock: Callable[[], float],
        changed: Callable[[], None],
        number: int = 1,
        access: Access = Access(),
        where: str = "",
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.controller, self.face, self.shared, self.clock, self.changed = (
            controller,
            face,
            shared,
            host_clock,
            changed,
        )
        #: Which of the gateway's surfaces this is, counted from 1.
        self.number = number
        self.access = access
        self.presets = Presets(
            face.surface.protocol.name, face.framing, where, controller.now, controller.loop.call_later, warn
        )
        self._clients: set[CommandProcessor] = set()
        self._turned: set[tuple[str, str]] = set()
        self._left: dict[str, tuple[float, dict[str, Any]]] = {}
        self._visits: set[_Visit] = set()

    def arrive(self, name: str, host: str, write: Callable[[bytes], Any]) -> ConnectionHandler:
        """A new connection. Raises TurnedAway."""
        self.admit(name, host)
        return self.come(name, host, write)

    def come(self, name: str, host: str, write: Callable[[bytes], Any]) -> ConnectionHandler:
        """A new connection that has been admitted."""
        face = self.face
        session = Session(face.model, face.settings, self.clock, self.shared, self.changed)
        at, kept = self._left.get(host, (-1e9, {}))
        if self.controller.now() - at <= INHERIT_FOR:
            session.kept = dict(kept)
        client = CommandProcessor(
            name,
            self.controller,
            face.surface,
            session,
            face.framing(self.controller.now),
            write,
            face.equinox,
            self.controller.transcript,
            self.controller.presence.arrive(host),
        )
        self._clients.add(client)
        if self.access.only_looks(host):
            client.rights = Rights(read_only=True)
            session.shared = Sealed(self.shared, lambda: client.refuse("a setting", "read only"))
        self.controller.transcript.put(name, "+", note=f"surface {self.number}, host {host}")
        rights = replace(client.rights, hibernate=self.access.hibernate)
        visit = _Visit(
            client,
            face,
            self.presets.listen(name, host),
            lambda: self._leave(name, host, client, visit),
            lambda: self._hand_on(host, client),
            _on_line(name, host),
            rights,
        )
        self._visits.add(visit)
        client.push()
        return visit

    def admit(self, name: str, host: str) -> None:
        """See whether a connection may be, and say once of a host why not. Raises TurnedAway."""
        self._clients = {client for client in self._clients if client.open or client.busy}
        if not self.access.admits(host):
            why = "it is not in allow"
        elif len(self._clients) >= self.access.most:
            why = f"there are {self.access.most} clients (max-clients) already"
        elif not _on_line(name, host) and (words := scarce()):
            why = words
        else:
            return
        if (host, why) not in self._turned and len(self._turned) < MOST_HOSTS:
            self._turned.add((host, why))
            self.controller.transcript.note(name, f"{host} was turned away from surface {self.number}: {why}")
        raise ConnectionRefused

    def here(self) -> list[str]:
        """The hosts of the programs that seem to be here: on a serial line, or between two connections, by what was
        heard lately."""
        now = self.controller.now()
        connected = {visit.host for visit in self._visits}
        between = [host for host, (at, _) in self._left.items() if host not in connected and now - at <= HERE]
        return [visit.host for visit in self._visits if not visit.lasting or now - visit.heard <= HERE] + between

    def programs(self) -> int:
        """How many they are."""
        return len(self.here())

    def _leave(self, name: str, host: str, client: CommandProcessor, visit: _Visit) -> None:
        self._visits.discard(visit)
        self.controller.transcript.put(name, "-")
        if visit.stranger:
            self.controller.presence.was_nobody(client.life)
            return
        self._hand_on(host, client)

    def _hand_on(self, host: str, client: CommandProcessor) -> None:
        """Nobody is at the other end any more: the next connection of this host goes on where this one has got to."""
        if client.life.closed is None:
            self.controller.presence.leave(client.life)
        self._left[host] = (self.controller.now(), dict(client.session.kept))
        for old in [key for key, (at, _) in self._left.items() if self.controller.now() - at > INHERIT_FOR]:
            del self._left[old]


def _on_line(name: str, host: str) -> bool:
    """Whether a connection is a serial line, real or virtual."""
    return host.removeprefix("pty:") == name


class _Visit:
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
        self._client, self._manners, self._left, self.lasting = client, face.manners, left, lasting
        self._handed_on = handed_on
        self._first: FirstWords | None = first
        self._screen: Beginning | None = None
        self._face, self._rights = face, rights
        self._controller = client.controller
        #: Whether it has turned out to be no program for telescopes.
        self.stranger = False
        self._hang_up: HangUp = lambda last: None
        #: When the bytes that are being fed came, where that was before now.
        self._came: float | None = None
        self.host, self.heard = client.life.who, -1e9
        self._begin = b""
        #: What waits for its turn: bytes, and how many stops there had been when they came.
        self._waiting: list[tuple[bytes, int]] = []
        self._backlog = Backlog()
        #: It was said that it is late; the other side has closed.
        self._said_late = self._gone = False
        self._take = self._on_line if lasting else self._listen if face.manners else client.feed

    @property
    def ended(self) -> bool:
        """Whether the last bytes did nothing but end motions without a reply."""
        return self._client.ended and not self._waiting

    @property
    def answered(self) -> bool:
        """Whether everything that was fed has been answered, as far as it is answered at all."""
        return not self._waiting and self._client.answered

    def feed(self, data: bytes) -> None:
        """Bytes have come."""
        if self._first is not None:
            self._first.hear(data)
            self._first = None if self._first.over else self._first
        now, was_late = self._controller.now(), self._backlog.late
        sent = self._backlog.sent(now)
        if self._backlog.late:
            self._come_late()
        elif was_late and not self._gone:
            self._client.life.closed = None  # it has caught up, so somebody is there
        self._feed(data, sent)
        self._backlog.took(len(data), now, self._controller.stops)

    def _come_late(self) -> None:
        """Nobody knows whether who sent this is still there: it holds no arrow."""
        if self._client.life.closed is None:
            self._controller.presence.leave(self._client.life)
        if not self._said_late:
            self._said_late = True
            self._client.transcript.note(
                self._client.name,
                "has sent so much that it is read too late: nothing of it "
                "sets the mount moving before all of it was read",
            )

    def gone(self) -> None:
        """The other side has closed its end: its time begins in which it may come back."""
        self._gone = True
        if not self.stranger:
            self._handed_on()

    def _feed(self, data: bytes, behind: int | None) -> None:
        """Take bytes in at once or in their turn; ``behind`` is how many stops there were when they may have come."""
        urgent = self._face.surface.ends.may_be_in(data)
        piled_up = sum(len(piece) for piece, _ in self._waiting) + len(data) > PATIENCE
        if urgent or (self._waiting and piled_up) or (not self._waiting and self._controller.turnstile.open()):
            self._go_on()
            self._take(data, behind)
            return
        self._waiting.append((data, self._controller.stops if behind is None else behind))
        if len(self._waiting) == 1:
            self._controller.turnstile.enter(self._go_on)

    def _go_on(self) -> None:
        """Everything that waits, in the order in which it came."""
        waiting, self._waiting = self._waiting, []
        for data, stops in waiting:
            self._take(data, stops)

    def _on_line(self, data: bytes, stops: int | None) -> None:
        """Feed the client, and remember that somebody is there."""
        self.heard = self._controller.now()
        self._client.feed(data, stops)

    def _listen(self, data: bytes, stops: int | None) -> None:
        """Feed the client, and look at what it says as long as it may be one that is known."""
        if self._manners:
            self._begin += data
            self._manners = tuple(manner for manner in self._manners if self._may_be(manner))
        self._client.feed(data, stops)

    def _may_be(self, manner: ClientProfile) -> bool:
        """Whether more must be heard; when enough was heard the client is treated so from here on."""
        if not self._begin.startswith(manner.first):
            return manner.first.startswith(self._begin)
        client, session = self._client, self._client.session
        client.equinox = manner.equinox or client.equinox
        session.settings = {**session.settings, **manner.settings}
        session.kept["precision"] = manner.settings.get("precision", session.kept["precision"])
        client.transcript.note(client.name, f"this is {manner.program}, and treated so")
        return False

    def serial(self, change_rate: Callable[[int], int]) -> None:
        self._client.rate = BaudTrial(change_rate)

    def network(self, hang_up: HangUp) -> None:
        """From here on nothing is heard before it is known that no stranger says it."""
        client, now = self._client, self._controller.now
        self._hang_up, self._after = hang_up, self._take
        self._screen = Beginning(self._face.beginning, self._face.surface.protocol.name)
        client.rights = self._rights
        client.came = lambda: now() if self._came is None else self._came
        client.framing = self._face.framing(client.came)
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
        speaks, client = self._face.speaks, self._client
        client.transcript.note(
            client.name,
            f"sends {greeting.words}; this is a port for programs that speak {speaks}: "
            "nothing of it reaches the mount, and the connection is closed",
        )
        self._hang_up(page(speaks, greeting.head_only) if greeting.http else b"")

    def close(self) -> None:
        self._go_on()
        if self._screen is not None and not self.stranger and self._screen.waiting:
            self._client.transcript.put(self._client.name, "x", self._screen.waiting, HALF_A_WORD)
        self._client.close()
        self._left()
