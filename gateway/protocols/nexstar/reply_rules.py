"""Talking to a hand control: requests out, replies in, framed by length.

A reply is as long as its picture; ``#`` is a legal data byte. A pass-through command whose device did not answer comes
back with one extra byte before the ``#`` (NexStar protocol, Pass-through Commands with No Response). What can be told
from one reply alone is told here; whether it is likely, the controller judges.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from gateway.core.errors import Fault, Garbled, NoDevice, Refused
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import Expected, kind
from gateway.protocols.wireformat.command_set import CommandSet, load

#: StarSense answers ``t`` with more than one byte: how many more at most.
EXTRA = {"t": 4}
#: Printable bytes that an echo is asked for; none is ``#``, and a proof shares none with the ones before it.
ECHOES = range(0x40, 0x7E)
#: Seconds that a hand control may take, at worst. Source: Developer Notes, Timeouts.
TIMEOUT = 3.5


class NexStarReplyRules:
    """What a line must know to exchange commands with a hand control."""

    protocol: CommandSet = load("nexstar")
    closing = b""

    def expected(self, ask: Send) -> Expected:
        """Every command is answered, by its length; a reply may be ``#`` alone."""
        return _expected(ask.command, ask.once, ask.raw)

    def alike(self, one: Send, other: Send) -> bool:
        """Whether the reply to the one could be taken for a reply to the other: by its length, that is all there is."""
        return not set(self._lengths(one)).isdisjoint(self._lengths(other))

    def _width(self, ask: Send) -> int:
        width = self.protocol.commands[ask.command].replies[0][1].width
        assert width is not None
        return width

    def _lengths(self, ask: Send) -> range:
        width = self._width(ask)
        return range(width, width + 1 + (1 if self._passed_through(ask) else EXTRA.get(ask.command, 0)))

    def _passed_through(self, ask: Send) -> bool:
        return self.protocol.commands[ask.command].request.literal.startswith(b"P")

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
        picture = self.protocol.commands[ask.command].replies[0][1]
        width = self._width(ask)
        if len(buffer) < width:
            return None
        if buffer[width - 1 : width] == b"#":
            return picture.decode(buffer[:width]), width
        longest = self._lengths(ask)[-1]
        end = buffer.find(b"#", width, longest)
        if end < 0:
            return None if len(buffer) < longest else (Garbled(), len(buffer))
        if self._passed_through(ask):
            return NoDevice(), end + 1
        return picture.decode(buffer[: width - 1] + b"#"), end + 1

    def proof(self, number: int) -> Iterator[Send]:
        """Exchanges that show the line to be in step again: two echoes of bytes that were not used lately."""
        for step in (2 * number, 2 * number + 1):
            yield Send("K", {"echo": ECHOES[step % len(ECHOES)]})

    def proven(self, ask: Send, values: Values) -> bool:
        """Whether a proof came back as it should."""
        return bool(values.get("echo") == ask.values["echo"])


@cache
def _expected(command: str, once: bool, raw: bool) -> Expected:
    protocol = NexStarReplyRules.protocol
    bare = protocol.commands[command].replies[0][1].width == 1
    return Expected(kind(protocol, command, once, raw), TIMEOUT, bare)
