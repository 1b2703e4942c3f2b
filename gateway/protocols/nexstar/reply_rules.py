"""Talking to a hand control: requests out, replies in, framed by length.

A reply is as long as its picture; ``#`` is a legal data byte. A pass-through command whose device did not answer comes
back with one extra byte before the ``#`` (NexStar protocol, Pass-through Commands with No Response). What can be told
from one reply alone is told here; whether it is likely, the controller judges.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from gateway.core.errors import Fault, Garbled, NoDevice, Refused
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import Expected, answer_kind
from gateway.protocols.wireformat.command import FrameTemplate
from gateway.protocols.wireformat.command_set import CommandSet, load

#: StarSense answers ``t`` with more than one byte: how many more at most.
EXTRA = {"t": 4}
#: Printable bytes that an echo is asked for; none is ``#``, and a check shares none with the ones before it.
ECHOES = range(0x40, 0x7E)
#: Seconds that a hand control may take, at worst. Source: Developer Notes, Timeouts.
TIMEOUT = 3.5


PROTOCOL = load("nexstar")


class _Reply(NamedTuple):
    """The reply to a command: its picture, its length, and the length that it may have besides."""

    picture: FrameTemplate
    width: int
    longest: int
    passed_through: bool


@cache
def _reply(command: str) -> _Reply:
    row = PROTOCOL.commands[command]
    picture = row.replies[0][1]
    assert picture.width is not None
    passed_through = row.request.prefix.startswith(b"P")
    longest = picture.width + (1 if passed_through else EXTRA.get(command, 0))
    return _Reply(picture, picture.width, longest, passed_through)


class NexStarReplyRules:
    protocol: CommandSet = PROTOCOL
    closing = b""

    def expected(self, ask: Send) -> Expected:
        """Every command is answered, by its length; a reply may be ``#`` alone."""
        return _expected(ask.command, ask.once, ask.raw)

    def ambiguous_with(self, one: Send, other: Send) -> bool:
        """Whether the reply to the one could be taken for a reply to the other: by its length, that is all there is."""
        first, second = _reply(one.command), _reply(other.command)
        return first.width <= second.longest and second.width <= first.longest

    def as_written(self, command: str, reply: bytes) -> bytes:
        """Every hand control writes alike."""
        return reply

    def encode(self, ask: Send) -> bytes:
        """The request bytes. Raises Fault for a value that has no form on the wire."""
        try:
            return self.protocol.commands[ask.command].request.encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """The reply at the start of the buffer and its length; None while it is incomplete.

        Raises ValueError for a field that cannot be read.
        """
        picture, width, longest, passed_through = _reply(ask.command)
        if len(buffer) < width:
            return None
        if buffer[width - 1 : width] == b"#":
            return picture.decode(buffer[:width]), width
        end = buffer.find(b"#", width, longest)
        if end < 0:
            return None if len(buffer) < longest else (Garbled(), len(buffer))
        if passed_through:
            return NoDevice(), end + 1
        return picture.decode(buffer[: width - 1] + b"#"), end + 1

    def resync_commands(self, number: int) -> Iterator[Send]:
        """Exchanges that show the line to be in step again: two echoes of bytes that were not used lately."""
        for step in (2 * number, 2 * number + 1):
            yield Send("K", {"echo": ECHOES[step % len(ECHOES)]})

    def is_resync_reply(self, ask: Send, values: Values) -> bool:
        return bool(values.get("echo") == ask.values["echo"])


@cache
def _expected(command: str, once: bool, raw: bool) -> Expected:
    return Expected(answer_kind(PROTOCOL, command, once, raw), TIMEOUT, unterminated=_reply(command).width == 1)
