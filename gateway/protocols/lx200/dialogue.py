"""Talking to a Meade: requests out, replies in.

A reply has one of five shapes: none, one character, text up to ``#``, one character and text, two texts (``:SC``). A
raw 0x15 instead of any of them, of none too, means busy (LX200GPS). Commands without a reply are followed by a short
pause, which old scopes need.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gateway.driver import Ask
from gateway.errors import Busy, Fault, Refused
from gateway.tables import Protocol, load

NAK = 0x15
TIMEOUT, PACE = 3.0, 0.05  # seconds


class MeadeDialogue:
    """What a line must know to exchange commands with a Meade."""

    protocol: Protocol = load("lx200")

    def timeout(self, ask: Ask) -> float:
        return TIMEOUT

    def pace(self, ask: Ask) -> float:
        return 0.0 if self.protocol.commands[ask.command].replies else PACE

    def encode(self, ask: Ask) -> bytes:
        """The request bytes; with ``low`` among the values in the low-precision form."""
        requests = self.protocol.commands[ask.command].requests
        try:
            return requests[1 if ask.values.get("low") and len(requests) > 1 else 0].encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def take(self, ask: Ask, buffer: bytes) -> tuple[dict[str, Any] | Fault, int] | None:
        """The reply at the start of the buffer and its length; None while it is incomplete.

        The fields come with ``length``: only by that is low precision told from high.
        """
        replies = self.protocol.commands[ask.command].replies
        if buffer[:1] == bytes((NAK,)):
            return Busy(), 1
        if not replies:
            return {}, 0
        if not buffer:
            return None
        for reply, picture in replies:
            taken = picture.take(buffer)
            if taken is None:
                continue
            values, length = taken
            if reply.fault is not None:
                return _fault(reply.fault, values), length
            return {**values, "length": length}, length
        return None

    def proof(self, attempt: int) -> Iterator[Ask]:
        """After quiet time: a position that can be read."""
        yield Ask("GR")

    def proven(self, ask: Ask, values: dict[str, Any]) -> bool:
        return "ra" in values


def _fault(name: str, values: dict[str, Any]) -> Fault:
    """The fault that a reply variant stands for, with the mount's own words where it sent some."""
    from gateway import errors

    kind: type[Fault] = getattr(errors, name)
    words = str(values.get("text", "")).strip()
    return kind(" ".join(words.split()) or None)
