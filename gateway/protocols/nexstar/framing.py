"""Framing of NexStar requests: the first byte gives the length; neither ``#`` nor the boundaries of a read count.

``#`` is a legal data byte; only replies have a terminator. The table holds the length of every opcode of any hand
control, even if the presented one lacks it, so that its data bytes are never read as commands. Stray bytes that
programs are known to send are dropped one by one. Any other byte that begins no command drops everything after it
until the line has been quiet for 0.1 s. A partial command is dropped after one second of quiet, and so is its end if
that arrives within another three: so the buffer never holds much more than one command.
"""

from __future__ import annotations

from functools import lru_cache

from gateway.core.errors import MappingError
from gateway.protocols.base.frames import QUIET_GAP, RESYNC_GAP, LengthFramer
from gateway.protocols.nexstar.interrupted import END_WITHIN, STRAY, Interrupted, Verdict, ends_motion
from gateway.protocols.wireformat.command_set import load

#: Lengths of later hand controls' opcodes, as programs send them; the gateway does not answer these. That of ``c`` is
#: not known.
UNANSWERED = {ord("g"): 18, ord("n"): 1, ord("o"): 1, ord("Y"): 1}
#: Extra bytes that some programs send right after a command, and at most how many: a number after ``y``, the mode that
#: belongs to ``T`` after ``t``, and four digits too many after a ``B`` below the horizon.
STRAY_AFTER = {ord("y"): (b"01", 1), ord("t"): (b"\0\1\2\3", 1), ord("B"): (b"0123456789ACDF", 4)}


@lru_cache(maxsize=1)
def all_lengths() -> dict[int, int]:
    """Return the length of every request by its first byte. Raises MappingError if one first byte has two lengths."""
    found = dict(UNANSWERED)
    for command in load("nexstar").commands.values():
        width = command.request.width
        if width is None:
            raise MappingError("mappings/nexstar/commands.toml", command.name, "the request must have a fixed length")
        first = command.request.prefix[0]
        if found.setdefault(first, width) != width:
            reason = f"requests that begin with {chr(first)!r} are {found[first]} bytes long, not {width}"
            raise MappingError("mappings/nexstar/commands.toml", command.name, reason)
    return found


class Framer(LengthFramer):
    """Cuts whole requests out of a byte stream, whether or not the presented hand control knows them.

    ``remembers``: the end of a dropped partial command is recognised, if it arrives late, and dropped, too.
    """

    noise = "no NexStar command begins like this; bytes are ignored until the line has been quiet for 0.1 s"
    half = "incomplete command: the rest did not arrive within a second"
    cut_off = "incomplete command: the rest did not arrive"
    late_end = "the end of the incomplete command before it, which is not carried out"

    def __init__(self, remembers: bool = True) -> None:
        super().__init__()
        self._remembers = remembers
        self._interrupted: Interrupted | None = None
        self._lengths = all_lengths()
        #: Stray bytes allowed after the last request, and how many more of them.
        self._stray, self._stray_left = b"", 0

    @property
    def idle(self) -> bool:
        """Whether the next byte begins a command that does not depend on earlier bytes."""
        return super().idle and self._interrupted is None

    @property
    def held(self) -> bool:
        """Whether bytes are held back until the line is quiet."""
        return self._interrupted is not None and bool(self._interrupted.burst)

    def feed(self, data: bytes, now: float) -> list[bytes]:
        """Like ``LengthFramer.feed``. Without data, it returns what was held back, if the line is quiet."""
        quiet = now - self._last_byte_at
        if self._remembers and self._pending and data and QUIET_GAP <= quiet < QUIET_GAP + END_WITHIN:
            self._interrupted = Interrupted(bytes(self._pending), now - quiet + QUIET_GAP + END_WITHIN, self._lengths)
        interrupted = self._interrupted
        if interrupted is None:
            return super().feed(data, now)
        self.dropped.clear()
        frames = []
        if self._pending:
            self._drop_half()
        if interrupted.burst and quiet >= RESYNC_GAP:
            frames = self._settle(interrupted)
        if now >= interrupted.until and not interrupted.burst:
            self._interrupted = None
        if self._interrupted is None:
            dropped = dict(self.dropped)
            frames += super().feed(data, now)
            self.dropped.update(dropped)
        elif data:
            self._last_byte_at = now
            frames += interrupted.add(data)
            if interrupted.decided:
                frames += self._settle(interrupted)
        return frames

    def _settle(self, interrupted: Interrupted) -> list[bytes]:
        """Decide about the bytes after an interrupted command; return those commands that were not passed on yet."""
        burst, missing, verdict = bytes(interrupted.burst), interrupted.missing, interrupted.verdict
        if verdict is Verdict.PART:
            interrupted.skip_part()
        else:
            self._interrupted = None
        commands = {Verdict.COMMANDS: burst, Verdict.END_AND_MORE: burst[missing:]}.get(verdict, b"")
        if ignored := burst[: len(burst) - len(commands)]:
            self._dropping = verdict is Verdict.NOISE
            self.dropped.add(ignored, self.noise if self._dropping else self.late_end)
        return [frame for frame in self._cut(commands) if not ends_motion(frame)]

    def _cut(self, data: bytes) -> list[bytes]:
        frames: list[bytes] = []
        pending = self._pending
        rest = iter(data)
        for byte in rest:
            if pending or byte in self._lengths:
                pending.append(byte)
                if len(pending) == self._lengths[pending[0]]:
                    frames.append(bytes(pending))
                    self._stray, self._stray_left = STRAY_AFTER.get(pending[0], (b"", 0))
                    pending.clear()
            elif self._stray_left and byte in self._stray:
                self._stray_left -= 1
            elif byte not in STRAY:
                self._dropping = True
                self.dropped.add(bytes((byte, *rest)), self.noise)
        return frames
