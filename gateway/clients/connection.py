"""One client connection: recognises the client, notices when its bytes are old, and cleans up at its end.

On network ports anyone may connect. A browser or port scanner is recognised and disconnected before it is answered.

A connection is behind while more bytes wait than one read takes. Such bytes may be old: they begin no motion if a stop
came after the connection fell behind, and after a second behind, they begin none at all. A connection has caught up
when a read leaves no bytes. If it was behind for more than a second, it must also stay so for a second.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.commands.turn import NO_DEADLINE
from gateway.clients.profiles import ClientProfile, SurfaceBinding
from gateway.clients.strangers import Greeting, Piece, StrangerFilter, answer
from gateway.clients.wrong_preset import FirstCommands
from gateway.transport.handler import Connected
from gateway.transport.tcp import READ_BYTES

#: Logged when a connection ends and its first bytes were neither a command nor recognised.
UNRECOGNISED_MESSAGE = "no command of this surface's protocol begins like this"
#: Seconds after which a connection that is behind is late.
LATE_TIME = 1.0
#: Seconds without data after which a connection that was behind has caught up.
CATCH_UP_TIME = 5.0


#: Processes received bytes. For bytes that waited: the number of stops when they were sent, the time of their arrival.
Deliver = Callable[[bytes, int | None, float | None], None]


class Backlog:
    """Tracks whether a connection is behind; ``is_late``: for more than a second. Times are loop times in seconds."""

    def __init__(self) -> None:
        self.is_late = False
        #: The number of stops when it fell behind; None while it is not behind.
        self._stop_count: int | None = None
        self._behind_since = self._last_data_at = -1e9

    def stops_before(self, now: float) -> int | None:
        """Return the number of stops at the earliest time the next bytes may have been sent; None if not behind."""
        if self._stop_count is not None and now - self._last_data_at > (LATE_TIME if self.is_late else CATCH_UP_TIME):
            self._stop_count, self.is_late = None, False
        self.is_late = self.is_late or (self._stop_count is not None and now - self._behind_since > LATE_TIME)
        return NO_DEADLINE if self.is_late else self._stop_count

    def add(self, size: int, now: float, stop_count: int) -> None:
        """Record that ``size`` bytes were read at ``now``, after ``stop_count`` stops."""
        if size >= READ_BYTES:
            if self._stop_count is None:
                self._stop_count, self._behind_since = stop_count, now
            self._last_data_at = now
        elif not self.is_late:
            self._stop_count = None


class ClientConnection:
    """A client's connection. Its first bytes identify the client program; on a network they are checked first.

    ``stays_present``: a serial line, whose clients do not visibly connect or disconnect. ``last_received_at``: the loop
    time of its last bytes. ``first_bytes``: bytes of this client that another handler has answered; they help to
    identify the program, too.
    """

    def __init__(
        self,
        connected: Connected,
        client: CommandProcessor,
        binding: SurfaceBinding,
        first_commands: FirstCommands,
        on_closed: Callable[[], None],
        save_state: Callable[[], None],
        first_bytes: bytes = b"",
    ) -> None:
        self.client, self._profiles, self._closed = client, binding.profiles, on_closed
        self.stays_present = connected.on_a_line
        self._save_state = save_state
        self._first_commands: FirstCommands | None = first_commands
        self._binding, self._hang_up = binding, connected.hang_up
        self._controller, self._wanted = client.controller, client.controller.wanted
        #: The name of the recognised client program; empty if unknown.
        self.profile = ""
        #: Whether the client is no telescope program.
        self.stranger = False
        self.host, self.last_received_at = connected.host, -1e9
        self._first_bytes = first_bytes
        self._backlog = Backlog()
        #: Whether its lateness was logged; whether the other end has closed.
        self._logged_late = self._peer_closed = False
        self._deliver: Deliver = (
            self._deliver_serial
            if self.stays_present
            else self._deliver_recognising
            if binding.profiles
            else client.feed
        )
        self._filter: StrangerFilter | None = None
        if connected.hang_up is not None:
            self._filter = StrangerFilter(binding.beginning, self.protocol)
            self._deliver_after_filter, self._deliver = self._deliver, self._deliver_screened

    @property
    def protocol(self) -> str:
        return self._binding.surface.protocol.name

    @property
    def answered(self) -> bool:
        """Whether no command of this connection waits for its reply."""
        return self.client.answered

    def feed(self, data: bytes) -> None:
        if self._first_commands is not None:
            self._first_commands.feed(data)
            self._first_commands = None if self._first_commands.is_done else self._first_commands
        now, was_late = self._controller.now(), self._backlog.is_late
        sent = self._backlog.stops_before(now)
        if self._backlog.is_late:
            self._note_late()
        elif was_late and not self._peer_closed:
            self._controller.presence.returned(self.client.activity)  # it has caught up, so a client is there
        self._deliver(data, sent, None)
        self._backlog.add(len(data), now, self._wanted.value.stops)

    def _note_late(self) -> None:
        """Treat the client as disconnected, because its bytes are old, and log that once."""
        if self.client.activity.closed is None:
            self._controller.presence.disconnected(self.client.activity)
        if not self._logged_late:
            self._logged_late = True
            self.client.log.note(
                "sends commands faster than the mount accepts them: the gateway begins no motion for it until it "
                "has caught up"
            )

    def peer_closed(self) -> None:
        """The other end has closed: from now on the client has a limited time to reconnect."""
        self._peer_closed = True
        self.client.unread_text.whole()
        if not self.stranger:
            self._save_state()

    def _deliver_serial(self, data: bytes, stop_count: int | None, arrived_at: float | None) -> None:
        """Process bytes from a serial line, and record the time."""
        self.last_received_at = self._controller.now()
        self.client.feed(data, stop_count, arrived_at)

    def _deliver_recognising(self, data: bytes, stop_count: int | None, arrived_at: float | None) -> None:
        """Process bytes, and compare the first bytes of the connection with the known client programs."""
        if self._profiles:
            self._first_bytes += data
            self._profiles = tuple(profile for profile in self._profiles if self._may_match(profile))
        self.client.feed(data, stop_count, arrived_at)

    def _may_match(self, profile: ClientProfile) -> bool:
        """Apply a profile if the first bytes match it. Return whether more bytes are needed to decide."""
        if not self._first_bytes.startswith(profile.first):
            return profile.first.startswith(self._first_bytes)
        self.profile = profile.program
        self.client.recognised(profile)
        return False

    def _deliver_screened(self, data: bytes, stops: int | None, arrived_at: float | None) -> None:
        """Process the bytes that cannot be a stranger's, with their time of arrival; disconnect a stranger."""
        now = self._controller.now()
        assert self._filter is not None
        pieces = self._filter.feed(Piece(data, now, self._controller.stops if stops is None else stops))
        if self._filter.stranger is not None:
            self._reject(self._filter.stranger)
            return
        if self._filter.done:
            self._deliver = self._deliver_after_filter
        for piece in pieces:
            late = piece.at != now
            self._deliver_after_filter(
                piece.data, piece.stop_count if late else stops, piece.at if late else arrived_at
            )

    def _reject(self, greeting: Greeting) -> None:
        """Log what the stranger sent, and close the connection."""
        assert self._hang_up is not None
        self.stranger, self._deliver = True, lambda data, stops, arrived: None
        if self._first_commands is not None:
            self._first_commands.end()
        titles, client = self._binding.titles, self.client
        client.log.note(
            f"sends {greeting.description}; this is a port for programs that speak {titles}: "
            "nothing of it reaches the mount, and the connection is closed"
        )
        self._hang_up(answer(titles) if greeting.http else b"")

    def close(self) -> None:
        if self._filter is not None and not self.stranger and self._filter.waiting:
            self.client.log.put("x", self._filter.waiting, UNRECOGNISED_MESSAGE)
        self.client.close()
        self._closed()
