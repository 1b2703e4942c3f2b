"""A NexStar command that was interrupted for longer than its time, and the bytes that arrive after it.

They may be its other end, which must move nothing, or a new command. The length decides: bytes that are exactly what
was missing, and may stand there, are the end and ignored; any other whole command is that command. The bytes therefore
wait until the line has been quiet for 0.1 s. What ends a motion does not wait, and is carried out in either case. Nor
does a question of several bytes that arrives whole (``K``, by which programs find out whether the line is in step).
"""

from __future__ import annotations

from enum import Enum, auto
from functools import cache

from gateway.protocols.wireformat.command_set import load

#: Seconds after an incomplete command was dropped, within which its end may still arrive.
END_WITHIN = 3.0
#: The longest command.
LONGEST = 18
#: Bytes that programs send around their commands: terminators, line ends, padding, ``?`` to wake the oldest mounts.
STRAY = frozenset(b"#? \r\n\0")


class Verdict(Enum):
    """What the bytes after an interrupted command are: its end, a part of it, its end and more, commands, or noise."""

    END = auto()
    PART = auto()
    END_AND_MORE = auto()
    COMMANDS = auto()
    NOISE = auto()


@cache
def _sample(letter: int) -> bytes:
    """Return a valid command that begins with this byte; empty if more than one has another form, or none is known."""
    found = [row.request for row in load("nexstar").commands.values() if row.request.prefix[:1] == bytes((letter,))]
    return found[0].encode(dict.fromkeys(found[0].fields, 0)) if len(found) == 1 else b""


@cache
def _marks() -> tuple[bytes, ...]:
    return tuple(command.mark for command in load("nexstar").commands.values() if command.urgent)


def ends_motion(frame: bytes) -> bool:
    """Whether this command ends a motion and does nothing else: ``M``, or a rate of 0."""
    return frame.startswith(_marks()) and load("nexstar").find(frame) is not None


def is_question(frame: bytes) -> bool:
    """Whether this command asks for a value and does nothing else."""
    found = load("nexstar").find(frame)
    return found is not None and found[0].question


class Interrupted:
    """An incomplete command that was dropped, how many bytes it lacks, and the ``burst`` of bytes since the last pause.

    ``until`` is the time after which its end is no longer expected, ``lengths`` those of all commands.
    """

    def __init__(self, half: bytes, until: float, lengths: dict[int, int]) -> None:
        self.missing, self.until, self.burst = lengths[half[0]] - len(half), until, bytearray()
        self._letter, self._at = half[0], len(half)
        self._lengths = lengths
        #: The places in the burst of commands that have been passed on.
        self._passed: set[int] = set()
        #: The bytes of the burst that arrived together at its beginning.
        self._first = b""

    def add(self, data: bytes) -> list[bytes]:
        """Add bytes to the burst, and return the ends of motions that they complete."""
        self._first = self._first or data
        self.burst += data
        found = dict(self._cut(0)[0]) | dict(self._cut(self.missing)[0])
        ends = [(place, frame) for place, frame in sorted(found.items()) if ends_motion(frame)]
        new = [frame for place, frame in ends if place not in self._passed]
        self._passed.update(place for place, _ in ends)
        return new

    def skip_part(self) -> None:
        """The burst was a part of the end: expect the remainder."""
        self.missing, self._at = self.missing - len(self.burst), self._at + len(self.burst)
        self.burst.clear()
        self._passed.clear()
        self._first = b""

    @property
    def decided(self) -> bool:
        """Whether no further byte can change the verdict."""
        count = len(self.burst)
        if not self._legal() or count > self.missing + LONGEST:
            return True
        if count == self.missing or not self._one_command():
            return False
        return count > self.missing or (count > 1 and self.burst == self._first and is_question(bytes(self.burst)))

    @property
    def verdict(self) -> Verdict:
        """What the burst is if nothing else belongs to it."""
        count = len(self.burst)
        if not self._legal() or (count != self.missing and self._one_command()):
            return Verdict.COMMANDS
        if count == self.missing:
            return Verdict.END
        if count > self.missing and self._cut(self.missing)[1]:
            return Verdict.END_AND_MORE
        if self._cut(0)[1] or any(mark.startswith(self.burst) or self.burst.startswith(mark) for mark in _marks()):
            return Verdict.COMMANDS
        return Verdict.PART if count < self.missing else Verdict.NOISE

    def _legal(self) -> bool:
        """Whether the bytes may stand where those that were missing would."""
        sample, rest = _sample(self._letter), bytes(self.burst[: self.missing])
        completed = sample[: self._at] + rest + sample[self._at + len(rest) :]
        return not sample or load("nexstar").find(completed) is not None

    def _one_command(self) -> bool:
        return len(self.burst) == self._lengths.get(self.burst[0])

    def _cut(self, at: int) -> tuple[list[tuple[int, bytes]], bool]:
        """Return the whole commands of the burst from here on with their places, and whether that is all there is."""
        found: list[tuple[int, bytes]] = []
        while at < len(self.burst):
            length = self._lengths.get(self.burst[at])
            if length is None and self.burst[at] not in STRAY:
                return found, False
            if length is not None:
                if at + length > len(self.burst):
                    return found, False
                found.append((at, bytes(self.burst[at : at + length])))
            at += length or 1
        return found, True
