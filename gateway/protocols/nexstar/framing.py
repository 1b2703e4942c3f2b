"""Framing of NexStar requests: the first byte gives the length; ``#`` and the boundaries of reads mean nothing.

The table holds the length of every opcode of any hand control, so that data bytes are never read as commands. After a
byte that begins no command all is dropped until 0.1 s of quiet. A partial command is dropped after one second of quiet.
Its end may arrive within another three seconds and must move nothing, so bytes that are exactly the missing ones are
ignored then. Other whole commands are carried out: stops at once, others as soon as they cannot be that end.
"""

from __future__ import annotations

from enum import Enum, auto
from functools import cache, lru_cache

from gateway.core.errors import MappingError
from gateway.protocols.base.frames import QUIET_GAP, RESYNC_GAP, LengthFramer
from gateway.protocols.wireformat.command_set import load

#: Seconds after an incomplete command was dropped, within which its end may still arrive.
END_WINDOW = 3.0
#: The longest command.
MAX_LENGTH = 18
#: Bytes that programs send around their commands: terminators, line ends, padding, ``?`` to wake the oldest mounts.
STRAY_BYTES = frozenset(b"#? \r\n\0")
#: Opcode -> request length, for opcodes of later hand controls that the gateway does not answer (``c``: not known).
UNANSWERED_LENGTHS = {ord("g"): 18, ord("n"): 1, ord("o"): 1, ord("Y"): 1}
#: Extra bytes that some programs send right after a command, and at most how many: a number after ``y``, the mode that
#: belongs to ``T`` after ``t``, and four digits too many after a ``B`` below the horizon.
STRAY_BY_OPCODE = {ord("y"): (b"01", 1), ord("t"): (b"\0\1\2\3", 1), ord("B"): (b"0123456789ACDF", 4)}


class Continuation(Enum):
    """What follows an interrupted command: its end, a part of its end, its end and more, other commands, or noise."""

    END = auto()
    PART = auto()
    END_AND_MORE = auto()
    COMMANDS = auto()
    NOISE = auto()


@cache
def _sample_command(opcode: int) -> bytes:
    """Return a valid command that begins with this byte; empty if none, or more than one, begins with it."""
    requests = [row.request for row in load("nexstar").commands.values() if row.request.prefix[:1] == bytes((opcode,))]
    return requests[0].encode(dict.fromkeys(requests[0].fields, 0)) if len(requests) == 1 else b""


@cache
def _prefixes() -> tuple[bytes, ...]:
    return tuple(command.urgent_mark for command in load("nexstar").commands.values() if command.urgent)


def ends_motion(frame: bytes) -> bool:
    """Whether this command ends a motion and does nothing else: ``M``, or a rate of 0."""
    return frame.startswith(_prefixes()) and load("nexstar").find(frame) is not None


def is_query(frame: bytes) -> bool:
    """Whether this command asks for a value and does nothing else."""
    match = load("nexstar").find(frame)
    return match is not None and match[0].is_query


class PartialCommand:
    """An incomplete command that was dropped, how many bytes it lacks, and the ``burst`` of bytes since the last pause.

    After ``expires_at`` its end is no longer expected. ``lengths`` are the lengths of all commands, by first byte.
    """

    def __init__(self, received: bytes, expires_at: float, lengths: dict[int, int]) -> None:
        self.missing, self.expires_at, self.burst = lengths[received[0]] - len(received), expires_at, bytearray()
        self._opcode, self._received_count = received[0], len(received)
        self._command_lengths = lengths
        #: The indices in the burst at which commands begin that have been passed on.
        self._passed_positions: set[int] = set()
        #: The bytes of the burst that arrived together at its beginning.
        self._first_bytes = b""

    def add(self, data: bytes) -> list[bytes]:
        """Add bytes to the burst; return the commands in it that end a motion, each of them only once."""
        self._first_bytes = self._first_bytes or data
        self.burst += data
        frames = dict(self._split(0)[0]) | dict(self._split(self.missing)[0])
        ends = [(place, frame) for place, frame in sorted(frames.items()) if ends_motion(frame)]
        new = [frame for place, frame in ends if place not in self._passed_positions]
        self._passed_positions.update(place for place, _ in ends)
        return new

    def skip_part(self) -> None:
        """Count the burst as a part of the missing bytes, and expect the remaining ones."""
        self.missing, self._received_count = self.missing - len(self.burst), self._received_count + len(self.burst)
        self.burst.clear()
        self._passed_positions.clear()
        self._first_bytes = b""

    @property
    def is_decided(self) -> bool:
        """Whether ``continuation`` counts now: further bytes cannot change it, or the burst is a query in one read."""
        count = len(self.burst)
        if not self._fits_command() or count > self.missing + MAX_LENGTH:
            return True
        if count == self.missing or not self._is_one_command():
            return False
        return count > self.missing or (count > 1 and self.burst == self._first_bytes and is_query(bytes(self.burst)))

    @property
    def continuation(self) -> Continuation:
        """What the burst is if no more bytes follow."""
        count = len(self.burst)
        if not self._fits_command() or (count != self.missing and self._is_one_command()):
            return Continuation.COMMANDS
        if count == self.missing:
            return Continuation.END
        if count > self.missing and self._split(self.missing)[1]:
            return Continuation.END_AND_MORE
        if self._split(0)[1] or any(mark.startswith(self.burst) or self.burst.startswith(mark) for mark in _prefixes()):
            return Continuation.COMMANDS
        return Continuation.PART if count < self.missing else Continuation.NOISE

    def _fits_command(self) -> bool:
        """Whether the command is valid with the burst in place of its missing bytes; True if its form is unknown."""
        sample, rest = _sample_command(self._opcode), bytes(self.burst[: self.missing])
        completed = sample[: self._received_count] + rest + sample[self._received_count + len(rest) :]
        return not sample or load("nexstar").find(completed) is not None

    def _is_one_command(self) -> bool:
        return len(self.burst) == self._command_lengths.get(self.burst[0])

    def _split(self, index: int) -> tuple[list[tuple[int, bytes]], bool]:
        """Return the whole commands of the burst from an index on, each with its index, and whether no byte is left."""
        frames: list[tuple[int, bytes]] = []
        while index < len(self.burst):
            length = self._command_lengths.get(self.burst[index])
            if length is None and self.burst[index] not in STRAY_BYTES:
                return frames, False
            if length is not None:
                if index + length > len(self.burst):
                    return frames, False
                frames.append((index, bytes(self.burst[index : index + length])))
            index += length or 1
        return frames, True


@lru_cache(maxsize=1)
def length_by_opcode() -> dict[int, int]:
    """Return the length of every request by its first byte. Raises MappingError if one first byte has two lengths."""
    widths = dict(UNANSWERED_LENGTHS)
    for command in load("nexstar").commands.values():
        width = command.request.length
        if width is None:
            raise MappingError("mappings/nexstar/commands.toml", command.name, "the request must have a fixed length")
        first = command.request.prefix[0]
        if widths.setdefault(first, width) != width:
            reason = f"requests that begin with {chr(first)!r} are {widths[first]} bytes long, not {width}"
            raise MappingError("mappings/nexstar/commands.toml", command.name, reason)
    return widths


class NexStarFramer(LengthFramer):
    """Cuts whole requests out of a byte stream, whether or not the presented hand control has them.

    ``drops_late_ends``: if the end of a dropped partial command arrives late, it is recognised and dropped, too.
    """

    noise_reason = "no NexStar command begins like this; bytes are ignored until the line has been quiet for 0.1 s"
    partial_reason = "incomplete command: the rest did not arrive within a second"
    cut_off_reason = "incomplete command: the rest did not arrive"
    late_reason = "the end of the incomplete command before it, which is not carried out"

    def __init__(self, drops_late_ends: bool = True) -> None:
        super().__init__()
        self._drops_late_ends = drops_late_ends
        self._partial_command: PartialCommand | None = None
        self._command_lengths = length_by_opcode()
        #: Stray bytes allowed after the last request, and how many more of them.
        self._stray, self._stray_left = b"", 0

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command that does not depend on earlier bytes."""
        return super().idle and self._partial_command is None

    @property
    def holds_bytes(self) -> bool:
        """Whether bytes are held back until the line is quiet."""
        return self._partial_command is not None and bool(self._partial_command.burst)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Like ``LengthFramer.feed``. Without data, it returns what was held back, if the line is quiet."""
        quiet = now - self._last_byte_at
        if self._drops_late_ends and self._pending and data and QUIET_GAP <= quiet < QUIET_GAP + END_WINDOW:
            until = self._last_byte_at + QUIET_GAP + END_WINDOW
            self._partial_command = PartialCommand(bytes(self._pending), until, self._command_lengths)
        interrupted = self._partial_command
        if interrupted is None:
            return super().feed(data, now)
        self.dropped.clear()
        frames = []
        if self._pending:
            self._drop_partial()
        if interrupted.burst and quiet >= RESYNC_GAP:
            frames = self._resolve_interrupted(interrupted)
        if now >= interrupted.expires_at and not interrupted.burst:
            self._partial_command = None
        if self._partial_command is None:
            dropped = dict(self.dropped)
            frames += super().feed(data, now)
            self.dropped.update(dropped)
        elif data:
            self._last_byte_at = now
            frames += interrupted.add(data)
            if interrupted.is_decided:
                frames += self._resolve_interrupted(interrupted)
        return frames

    def _resolve_interrupted(self, interrupted: PartialCommand) -> list[bytes]:
        """Decide about the bytes after an interrupted command; return those commands that were not passed on yet."""
        burst, missing, verdict = bytes(interrupted.burst), interrupted.missing, interrupted.continuation
        if verdict is Continuation.PART:
            interrupted.skip_part()
        else:
            self._partial_command = None
        commands = {Continuation.COMMANDS: burst, Continuation.END_AND_MORE: burst[missing:]}.get(verdict, b"")
        if ignored := burst[: len(burst) - len(commands)]:
            self._dropping = verdict is Continuation.NOISE
            self.dropped.add(ignored, self.noise_reason if self._dropping else self.late_reason)
        return [frame for frame in self._cut_commands(commands) if not ends_motion(frame)]

    def _cut_commands(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        pending = self._pending
        rest = iter(data)
        for byte in rest:
            if pending or byte in self._command_lengths:
                pending.append(byte)
                if len(pending) == self._command_lengths[pending[0]]:
                    frames.append(bytes(pending))
                    self._stray, self._stray_left = STRAY_BY_OPCODE.get(pending[0], (b"", 0))
                    pending.clear()
            elif self._stray_left and byte in self._stray:
                self._stray_left -= 1
            elif byte not in STRAY_BYTES:
                self._dropping = True
                self.dropped.add(bytes((byte, *rest)), self.noise_reason)
        return frames
