"""Talking to a hand control: requests out, replies in, framed by length.

A reply is as long as its picture; ``#`` is a legal data byte. A pass-through command whose device did not answer comes
back with one extra byte before the ``#`` (NexStar protocol, Pass-through Commands with No Response).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.driver import Ask
from gateway.errors import Fault, NoDevice, Refused
from gateway.tables import Protocol, load

#: How many bytes more than its picture a reply may have: StarSense answers ``t`` with more than one.
EXTRA = 4


class NexStarDialogue:
    """What a line must know to exchange commands with a hand control. Source: Developer Notes, Timeouts."""

    protocol: Protocol = load("nexstar")

    def timeout(self, ask: Ask) -> float:
        """A hand control may take 3.5 s, at worst."""
        return 3.5

    def pace(self, ask: Ask) -> float:
        """Every command is answered, so none need be waited for beyond its answer."""
        return 0.0

    def encode(self, ask: Ask) -> bytes:
        """The request bytes. Raises Fault for a value that has no form on the wire."""
        try:
            return self.protocol.commands[ask.command].request.encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def take(self, ask: Ask, buffer: bytes) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply at the start of the buffer and its length; None while it is incomplete."""
        picture = self.protocol.commands[ask.command].replies[0][1]
        width = picture.width
        assert width is not None
        if len(buffer) < width:
            return None
        if buffer[width - 1 : width] == b"#":
            return picture.decode(buffer[:width]), width
        if self.protocol.commands[ask.command].request.literal.startswith(b"P"):
            return None if len(buffer) <= width else (NoDevice(), width + 1)
        end = buffer.find(b"#", width)
        if end < 0:
            return None if len(buffer) < width + EXTRA else (Refused("Garbled answer from the mount."), len(buffer))
        return picture.decode(buffer[: width - 1] + b"#"), end + 1

    def proof(self, attempt: int) -> Iterator[Ask]:
        """Exchanges that show the line to be in step again: two echoes of different bytes."""
        for byte in (0x78, 0x59 - attempt % 8):
            yield Ask("K", {"echo": byte})

    def proven(self, ask: Ask, values: dict[str, Any]) -> bool:
        """Whether a proof came back as it should."""
        return bool(values.get("echo") == ask.values["echo"])
