"""A capture of either protocol as a conversation: every command named, every reply taken apart, in order of time.

Commands are cut out of the bytes as a surface does it, replies as a driver does it: by the commands they answer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import Any

from gateway.captures import Chunk
from gateway.driver import Ask
from gateway.errors import Fault, Refused, UserError
from gateway.frames import Framing, Unterminated
from gateway.logline import EVENTS, row, stamp
from gateway.recording import BOOKKEEPING
from gateway.tables import load
from gateway.talk import Dialogue

#: Seconds between two bytes where a capture tells no times: enough that a byte which is no command costs no other one,
#: and so few that no command falls apart.
APART = 0.2
#: How a protocol's commands are cut out, by a clock that tells when bytes came.
Cutting = Callable[[Callable[[], float]], Framing]
#: Commands of one side whose replies may still be due, and bytes that may still become a reply.
DUE, LONGEST = 256, 4096
#: So many commands that no protocol has are shown of one side.
NOISE = 1000
#: Bytes by which it is told whether a capture is a conversation.
ENOUGH = 4096


class _Talk:
    """One side's commands and the replies that are still due."""

    def __init__(self, protocol: str, framing: Cutting, dialogue: Dialogue) -> None:
        self._now = 0.0
        self.protocol, self._framing, self._dialogue = protocol, framing(lambda: self._now), dialogue
        self._due: deque[Ask] = deque(maxlen=DUE)
        self._rest = b""
        #: How many commands were none that the protocol has; bytes of commands, and those of them that were some.
        self.unknown = self.heard = self.understood = 0

    def _frames(self, data: bytes, at: float | None) -> Iterator[bytes]:
        """The commands that these bytes complete, which came at that time (seconds) or nobody knows when."""
        if at is not None:
            self._now = at
            yield from self._framing(data)
            return
        for number in range(len(data)):
            self._now += APART
            yield from self._framing(data[number : number + 1])

    def commands(self, data: bytes, at: float | None) -> Iterator[tuple[bytes, str]]:
        """The commands that these bytes complete, with their names and fields."""
        self.heard += len(data)
        for frame in self._frames(data, at):
            if isinstance(frame, Unterminated):
                self._due += [Ask(name) for name in frame.names[:1] if name and not frame.late]
                yield frame, "its end (#) is missing: refused"
                continue
            found = load(self.protocol).find(frame)
            if found is None:
                self.unknown += 1
                if self.unknown <= NOISE:
                    yield frame, f"no command of the {self.protocol} protocol"
                continue
            command, picture = found
            try:
                values = picture.decode(frame)
            except ValueError as error:
                yield frame, f"{command.help}; not valid: {error}"
                continue
            self.understood += len(frame)
            if command.replies:
                self._due.append(Ask(command.name, values))
            yield frame, _fields(command.help, values)

    def replies(self, data: bytes) -> Iterator[tuple[bytes, str]]:
        """The replies that these bytes complete."""
        self._rest += data
        while self._rest:
            taken = self._take()
            if taken is None and len(self._rest) <= LONGEST:
                break
            if taken is None:
                taken = "fits nothing that was asked", len(self._rest)
            words, length = taken
            yield self._rest[:length], words
            self._rest = self._rest[length:]

    def _take(self) -> tuple[str, int] | None:
        """What the bytes answer: the oldest command that they fit; those before it were never answered."""
        for skipped, ask in enumerate(self._due):
            try:
                taken = self._dialogue.take(ask, self._rest)
            except ValueError as error:
                taken = Refused(f"garbled: {error}"), len(self._rest)
            if taken is not None and taken[1]:
                for _ in range(skipped + 1):
                    self._due.popleft()
                return _reply(load(self.protocol).commands[ask.command].name, *taken)
        return None if self._due else ("nobody asked", len(self._rest))


def _reply(name: str, outcome: dict[str, Any] | Fault, length: int) -> tuple[str, int]:
    if isinstance(outcome, Fault):
        return f"{name}: {outcome}", length
    return _fields(f"{name}:", {key: value for key, value in outcome.items() if key != "length"}), length


def _fields(words: str, values: dict[str, Any]) -> str:
    return " ".join([words, *(f"{name}={_short(value)}" for name, value in values.items())])


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


class NoConversation(UserError):
    """What was to be decoded is nothing that a client says to a mount."""


def decode(found: Iterable[Chunk], talk: Callable[[str], tuple[str, Cutting, Dialogue]],
           began: float | None) -> Iterator[str]:
    """Lines of text. ``talk`` tells of a side its protocol, its framing, its dialogue; ``began`` is Unix seconds.

    Of what is no command only so much is shown. Raises NoConversation where that is most of a capture without times.
    """
    talks: dict[str, _Talk] = {}
    for chunk in found:
        if chunk.arrow == "r" or chunk.arrow in BOOKKEEPING:
            continue
        if chunk.side not in talks or chunk.arrow == "+":
            talks[chunk.side] = _Talk(*talk(chunk.side))
        side = talks[chunk.side]
        if chunk.arrow not in "<>":
            if chunk.arrow == "-":
                yield from _left_out(talks.pop(chunk.side), chunk, began)
            text = chunk.data.decode("latin-1")
            yield _line(chunk, began, b"", ", ".join(filter(None, (EVENTS.get(chunk.arrow, ""), text))))
            continue
        for data, words in side.commands(chunk.data, chunk.at) if chunk.arrow == ">" else side.replies(chunk.data):
            yield _line(chunk, began, data, words)
        if chunk.at is None and side.heard >= ENOUGH and side.understood < side.heard / 2:
            raise NoConversation(f"this is no conversation in the {side.protocol} protocol: of its first {side.heard} "
                                 f"bytes only {side.understood} are commands; the rest was not decoded")
    for name, left in talks.items():
        yield from _left_out(left, Chunk(None, name, "!", b""), began)


def _left_out(side: _Talk, chunk: Chunk, began: float | None) -> Iterator[str]:
    """How much of what was no command has not been shown."""
    if side.unknown > NOISE:
        yield _line(chunk._replace(arrow="!"), began, b"",
                    f"{side.unknown - NOISE} more that are no commands of the {side.protocol} protocol are not shown")


def folded(lines: Iterable[str]) -> Iterator[str]:
    """The same, with lines that are repeated told once and counted: of a capture without times they say no more."""
    for line, same in groupby(lines):
        yield line
        times = sum(1 for _ in same) - 1
        if times:
            yield line if times == 1 else f"    the same {times} times more"


def _line(chunk: Chunk, began: float | None, data: bytes, words: str) -> str:
    clock = "" if chunk.at is None else stamp(chunk.at + (began or 0.0)) + " "
    return clock + row(chunk.side, chunk.arrow, data, words)


def guess(sent: bytes) -> str | None:
    """The protocol of what a client has sent, by what its commands look like; None when nothing was."""
    if not sent:
        return None
    return "lx200" if sent.count(b":") + sent.count(b"\x06") > 0 and sent.lstrip(b"#")[:1] in b":\x06$" else "nexstar"
