"""One client connection: recognises the client, notices when its bytes are old, and cleans up at its end.

On network ports anyone may connect. A browser or port scanner is recognised and disconnected before it is answered.

A connection is behind while more bytes wait than one read takes. Such bytes may be old: they begin no motion if a stop
came after the connection fell behind, or if it has been behind for more than a second. A connection has caught up when
a read leaves no bytes. After more than a second behind, it has caught up only when no read has left bytes for a second.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.clients.commands.command_processor import CommandProcessor
from gateway.clients.commands.turn import STALE_STOP_COUNT
from gateway.clients.profiles import ClientProfile, SurfaceBinding
from gateway.clients.strangers import Greeting, ReceivedBytes, StrangerFilter, http_answer
from gateway.clients.wrong_preset import FirstCommandCheck
from gateway.transport.handler import NewConnection
from gateway.transport.tcp import READ_BYTES

#: Logged when a connection ends and its first bytes were neither a command nor recognised.
UNRECOGNISED_MESSAGE = "no command of this surface's protocol begins like this"
#: Seconds after which a connection that is behind is late; a late one has caught up after as long without a full read.
LATE_AFTER = 1.0
#: Seconds without a full read after which a connection that was behind, but not late, has caught up.
CATCH_UP_TIME = 5.0


#: Processes bytes. The arguments are those of ``CommandProcessor.feed``: ``data``, ``stop_count``, ``arrived_at``.
DeliverBytes = Callable[[bytes, int | None, float | None], None]


class Backlog:
    """Tracks whether a connection is behind: whether more of its bytes wait than one read takes. ``is_late``: it was
    behind for more than a second, and has not caught up since. Times are loop times in seconds.
    """

    def __init__(self) -> None:
        self.is_late = False
        #: The number of stops when it fell behind; None while it is not behind.
        self._stop_count: int | None = None
        self._behind_since = self._full_read_at = -1e9

    def stop_count_when_sent(self, now: float) -> int | None:
        """Return a lower bound of the number of stops when the next bytes were sent; -1 if late, None if not behind."""
        if self._stop_count is not None and now - self._full_read_at > (LATE_AFTER if self.is_late else CATCH_UP_TIME):
            self._stop_count, self.is_late = None, False
        self.is_late = self.is_late or (self._stop_count is not None and now - self._behind_since > LATE_AFTER)
        return STALE_STOP_COUNT if self.is_late else self._stop_count

    def record_read(self, size: int, now: float, stop_count: int) -> None:
        """Record that ``size`` bytes were read at ``now``, after ``stop_count`` stops."""
        if size >= READ_BYTES:
            if self._stop_count is None:
                self._stop_count, self._behind_since = stop_count, now
            self._full_read_at = now
        elif not self.is_late:
            self._stop_count = None


class ClientConnection:
    """A client's connection. Its first bytes identify the client program; on a network they may show a stranger.

    ``is_serial_line``: clients do not visibly connect or disconnect; only then ``last_received_at`` is the loop time of
    the last bytes. Another handler has answered ``first_bytes``; they also identify the client program.
    """

    def __init__(
        self,
        new_connection: NewConnection,
        client: CommandProcessor,
        binding: SurfaceBinding,
        first_command_check: FirstCommandCheck,
        on_closed: Callable[[], None],
        save_state: Callable[[], None],
        first_bytes: bytes = b"",
    ) -> None:
        self.client, self._profiles, self._on_closed = client, binding.profiles, on_closed
        self.is_serial_line = new_connection.is_serial_line
        self._save_state = save_state
        self._first_command_check: FirstCommandCheck | None = first_command_check
        self._binding, self._hang_up = binding, new_connection.hang_up
        self._controller, self._wanted_state = client.controller, client.controller.wanted
        #: The name of the recognised client program; empty if unknown.
        self.program_name = ""
        #: Whether the client is no telescope program.
        self.is_stranger = False
        self.host, self.last_received_at = new_connection.host, -1e9
        self._first_bytes = first_bytes
        self._backlog = Backlog()
        #: Whether it was logged that the connection is late; whether the other end has closed.
        self._has_logged_late = self._peer_closed = False
        self._deliver: DeliverBytes = (
            self._deliver_serial
            if self.is_serial_line
            else self._deliver_and_recognise
            if binding.profiles
            else client.feed
        )
        self._stranger_filter: StrangerFilter | None = None
        if new_connection.hang_up is not None:
            self._stranger_filter = StrangerFilter(binding.opening_pattern, self.protocol)
            self._deliver_after_filter, self._deliver = self._deliver, self._deliver_filtered

    @property
    def protocol(self) -> str:
        return self._binding.surface.protocol.name

    @property
    def all_answered(self) -> bool:
        """Whether no command of this connection waits for its reply."""
        return self.client.all_answered

    def feed(self, data: bytes) -> None:
        if self._first_command_check is not None:
            self._first_command_check.feed(data)
            self._first_command_check = None if self._first_command_check.is_done else self._first_command_check
        now, was_late = self._controller.now(), self._backlog.is_late
        stop_count = self._backlog.stop_count_when_sent(now)
        if self._backlog.is_late:
            self._note_late()
        elif was_late and not self._peer_closed:
            self._controller.presence.mark_open_again(self.client.activity)  # it has caught up, so a client is there
        self._deliver(data, stop_count, None)
        self._backlog.record_read(len(data), now, self._wanted_state.value.stop_count)

    def _note_late(self) -> None:
        """Treat the client as disconnected, because its bytes are old, and log that once."""
        if self.client.activity.closed_at is None:
            self._controller.presence.mark_closed(self.client.activity)
        if not self._has_logged_late:
            self._has_logged_late = True
            self.client.log.note(
                "sends commands faster than the mount accepts them: the gateway begins no motion for it until it "
                "has caught up"
            )

    def peer_closed(self) -> None:
        """Send held-back text, and save the state of a client that is no stranger: the other end has closed."""
        self._peer_closed = True
        self.client.unread_text.stop_holding_back()
        if not self.is_stranger:
            self._save_state()

    def _deliver_serial(self, data: bytes, stop_count: int | None, arrived_at: float | None) -> None:
        """Process bytes from a serial line, and record the time."""
        self.last_received_at = self._controller.now()
        self.client.feed(data, stop_count, arrived_at)

    def _deliver_and_recognise(self, data: bytes, stop_count: int | None, arrived_at: float | None) -> None:
        """Process bytes, and compare the first bytes of the connection with the known client programs."""
        if self._profiles:
            self._first_bytes += data
            self._profiles = tuple(profile for profile in self._profiles if self._try_profile(profile))
        self.client.feed(data, stop_count, arrived_at)

    def _try_profile(self, profile: ClientProfile) -> bool:
        """Apply a profile if the first bytes match it. Return whether more bytes are needed to decide."""
        if not self._first_bytes.startswith(profile.first_bytes):
            return profile.first_bytes.startswith(self._first_bytes)
        self.program_name = profile.program
        self.client.apply_profile(profile)
        return False

    def _deliver_filtered(self, data: bytes, stop_count: int | None, arrived_at: float | None) -> None:
        """Process the bytes that cannot come from a stranger, with their times of arrival; disconnect a stranger."""
        now = self._controller.now()
        assert self._stranger_filter is not None
        pieces = self._stranger_filter.feed(
            ReceivedBytes(data, now, self._controller.stop_count if stop_count is None else stop_count)
        )
        if self._stranger_filter.stranger is not None:
            self._reject(self._stranger_filter.stranger)
            return
        if self._stranger_filter.is_done:
            self._deliver = self._deliver_after_filter
        for piece in pieces:
            was_held = piece.arrived_at != now
            self._deliver_after_filter(
                piece.data, piece.stop_count if was_held else stop_count, piece.arrived_at if was_held else arrived_at
            )

    def _reject(self, greeting: Greeting) -> None:
        """Log what the stranger sent, and close the connection."""
        assert self._hang_up is not None
        self.is_stranger, self._deliver = True, lambda data, stops, arrived: None
        if self._first_command_check is not None:
            self._first_command_check.end()
        titles, client = self._binding.protocol_titles, self.client
        client.log.note(
            f"sends {greeting.description}; this is a port for programs that speak {titles}: "
            "nothing of it reaches the mount, and the connection is closed"
        )
        self._hang_up(http_answer(titles) if greeting.is_http else b"")

    def close(self) -> None:
        if self._stranger_filter is not None and not self.is_stranger and self._stranger_filter.held_bytes:
            self.client.log.put("x", self._stranger_filter.held_bytes, UNRECOGNISED_MESSAGE)
        self.client.close()
        self._on_closed()
