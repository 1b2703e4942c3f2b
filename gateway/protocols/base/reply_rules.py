"""What a line must know to exchange a protocol's commands with a mount: how requests and replies look on the wire."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from gateway.core.errors import Fault
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.wireformat.command_set import CommandSet


def kind(commands: CommandSet, ask: Send) -> str | None:
    """What the answer may do from one time to the next, by the tables; None where it is believed as it comes.

    What a program is told as the mount has written it is asked again like a state, whatever it is.
    """
    answer = commands.commands[ask.command].answer
    if ask.once or answer == "stream":
        return None
    return answer or ("state" if ask.raw else None)


class Replies(Protocol):
    """How replies are taken apart: the reply at the start of the bytes, or the fault that it is, and its length."""

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None: ...


class ReplyRules(Replies, Protocol):
    """How a protocol's requests and replies look on the wire. ``closing`` ends a command of which half was sent.

    It is sent, too, behind an unanswered one that ``leaves_open`` what follows.
    """

    closing: bytes

    def timeout(self, ask: Send) -> float: ...
    def pace(self, ask: Send) -> float: ...
    def leaves_open(self, ask: Send) -> bool: ...
    def bare(self, ask: Send) -> bool: ...
    def alike(self, one: Send, other: Send) -> bool: ...
    def kind(self, ask: Send) -> str | None: ...
    def as_written(self, command: str, reply: bytes) -> bytes: ...
    def encode(self, ask: Send) -> bytes: ...
    def proof(self, number: int) -> Iterator[Send]: ...
    def proven(self, ask: Send, values: Values) -> bool: ...
