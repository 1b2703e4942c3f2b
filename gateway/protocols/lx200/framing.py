"""Cuts the bytes of LX200 clients into commands: from a ``:`` to a ``#``, or a raw 0x06.

A ``:`` in front of a letter, ``$`` or ``?`` begins a new command, because some programs omit a ``#``. But a command
with an argument and no ``#`` is dangerous: a ``:MS#`` after half a ``:Sr`` would slew to the previous target. It is
refused with everything up to the next ``#``, and further commands are ``Suspect`` until the client pauses for a tenth
of a second. Stops are passed on as always.
"""

from __future__ import annotations

from functools import cache

from gateway.protocols.base.frames import DroppedBytes, Suspect, Unterminated
from gateway.protocols.wireformat.command_set import load

ACK = 0x06
MAX_COMMAND_LENGTH = 64
#: Seconds of quiet that end a burst of bytes: what follows does not continue what came before.
BURST_GAP = 0.1
#: Why bytes are dropped, for the log.
NOISE = "no command of an LX200 begins so"
NO_HASH = "a command without its end (#)"
TOO_LONG = "longer than any command of an LX200"
_IGNORED = frozenset(b"\r\n\x00")
_COLON, _HASH, _DOLLAR = b":#$"
_FIRST_BYTES = frozenset(b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz$?")


def setter_name(beginning: bytes) -> str | None:
    """Return the name of the command with an argument that these bytes begin; "" for an unknown ``:S``, else None."""
    command = load("lx200").begun_command(beginning)
    if command is not None:
        return command.name if command.request.fields else None
    return "" if beginning.startswith(b":S") else None


@cache
def stop_commands() -> tuple[bytes, ...]:
    """The stop commands that are passed on even within a refused burst: they end something and do nothing else."""
    commands = load("lx200").commands.values()
    return tuple([command.request.prefix for command in commands if command.urgent in ("stop", "axis", "part")])


class Lx200Framer:
    """Cuts a byte stream into whole commands, such as ``b":GR#"``, ``b"$Q#"`` or the single byte 0x06 (ACK)."""

    #: This framer never delays bytes until the line is quiet.
    holds_bytes = False

    def __init__(self) -> None:
        self._frame = bytearray()
        self._pending_colon = False
        self._last_byte_at = 0.0
        #: Whether the incomplete command is from before the last pause.
        self._began_before_pause = False
        #: The names of the commands in an unterminated text (empty: there is none), and that text.
        self._unterminated_names: dict[str, None] = {}
        self._unterminated_text = bytearray()
        #: Whether the commands of this burst are suspect.
        self._is_suspect = False
        self._frames: list[bytes] = []
        self.dropped = DroppedBytes()

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command that does not depend on earlier bytes."""
        return not (self._frame or self._is_suspect)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Return the commands that these bytes complete, in order. ``now`` is a monotonic time in seconds."""
        if not data:
            return []
        self._frames = []
        self.dropped.clear()
        quiet, self._last_byte_at = now - self._last_byte_at, now
        if quiet >= BURST_GAP:
            self._begin_burst()
        for byte in data:
            if byte in _IGNORED:
                continue
            if byte == ACK:
                self._end_incomplete()
                if not self._unterminated_names:
                    self._frames.append(bytes((ACK,)))
                self._begin_command()
            elif byte == _HASH:
                self._add_pending_colon()
                self._end_command()
            else:
                self._handle_byte(byte)
        return self._frames

    def _begin_command(self, first: bytes = b"") -> None:
        self._frame = bytearray(first)
        self._pending_colon = self._began_before_pause = False

    def _begin_burst(self) -> None:
        """After a pause begin a burst: nothing is suspect. Report an unterminated text; keep a stop that has begun."""
        self._is_suspect = False
        self._began_before_pause = bool(self._frame)
        if self._unterminated_names:
            piece = b":" if self._pending_colon else bytes(self._frame)
            self._report_unterminated()
            self._begin_command(piece if any(stop.startswith(piece) for stop in stop_commands()) else b"")

    def _report_unterminated(self) -> None:
        """Report the unterminated text without waiting for its end."""
        self._extend_unterminated(bytes(self._frame), setter_name(bytes(self._frame)))
        self._frames.append(Unterminated(bytes(self._unterminated_text), tuple(self._unterminated_names), late=True))
        self._unterminated_names = {}

    def end(self) -> list[Unterminated]:
        """Handle a disconnection; return an incomplete command if it has an argument: the caller has to refuse it."""
        self._frames, self._began_before_pause = [], True
        self.dropped.clear()
        if self._unterminated_names:
            self._report_unterminated()
        else:
            self._end_incomplete()
        self._begin_command()
        return [frame for frame in self._frames if isinstance(frame, Unterminated)]

    def _end_incomplete(self, reason: str = NO_HASH) -> None:
        """End the incomplete command here: with an argument it is unterminated, any other is dropped."""
        piece = bytes(self._frame)
        name = setter_name(piece) if len(piece) > 1 else None
        if self._unterminated_names:
            self._extend_unterminated(piece, name)
            if piece + b"#" in stop_commands():
                self._frames.append(piece + b"#")
        elif name is not None and self._began_before_pause:
            self._frames.append(Unterminated(piece, (name,), late=True))
        elif name is not None:
            self._unterminated_text.clear()
            self._is_suspect = True
            self._extend_unterminated(piece, name)
        elif len(piece) > 1:
            self.dropped.add(piece, reason)

    def _extend_unterminated(self, piece: bytes, command: str | None) -> None:
        """Add a piece to the unterminated text, which is logged, and its command to those that will be refused."""
        self._unterminated_text += piece[: MAX_COMMAND_LENGTH - len(self._unterminated_text)]
        if command is not None:
            self._unterminated_names[command] = None

    def _end_command(self) -> None:
        """Handle a ``#``: it ends a command, or an unterminated text."""
        frame = bytes(self._frame) + b"#"
        if self._unterminated_names:
            self._extend_unterminated(frame[:-1], setter_name(frame[:-1]))
            self._frames.append(Unterminated(bytes(self._unterminated_text) + b"#", tuple(self._unterminated_names)))
            self._unterminated_names = {}
            if frame in stop_commands():
                self._frames.append(frame)
        elif len(frame) > 2:
            self._frames.append(Suspect(frame) if self._is_suspect else frame)
        self._begin_command()

    def _add_pending_colon(self) -> None:
        """Add the colon that was held back: it is part of the argument."""
        if self._pending_colon:
            self._pending_colon = False
            self._append_byte(_COLON)

    def _append_byte(self, byte: int) -> None:
        """Add a byte to the command; drop a command that is too long."""
        self._frame.append(byte)
        self._began_before_pause = False
        if len(self._frame) > MAX_COMMAND_LENGTH:
            self._end_incomplete(TOO_LONG)
            self._begin_command()

    def _handle_byte(self, byte: int) -> None:
        if byte == _COLON:
            if len(self._frame) > 1:
                self._add_pending_colon()
                self._pending_colon = True  # a separator in the argument, or the next command: the next byte decides
            else:
                self._begin_command(b":")
            return
        if self._pending_colon:
            if byte in _FIRST_BYTES:
                self._end_incomplete()
                self._begin_command(b":")
            else:
                self._add_pending_colon()
        if not self._frame:
            if byte == _DOLLAR:
                self._frame.append(byte)
            else:
                self.dropped.add(bytes((byte,)), NOISE)
            return
        if self._frame == b"$" and byte != ord("Q"):
            self.dropped.add(b"$" if byte == _DOLLAR else bytes((_DOLLAR, byte)), NOISE)
            self._begin_command(b"$" if byte == _DOLLAR else b"")
            return
        self._append_byte(byte)
