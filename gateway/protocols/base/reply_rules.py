"""What a line must know to exchange a protocol's commands with a mount: how requests and replies look on the wire.

A protocol that is never spoken to a mount has its replies taken apart by the tables alone, for the log and ``decode``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, Protocol

from gateway.core import errors
from gateway.core.errors import Fault
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.wireformat.command_set import CommandSet


class Expected(NamedTuple):
    """What is known of an answer before it comes.

    ``kind`` is what it may do from one time to the next, None where it is believed as it comes or the command is no
    question. It may take ``timeout`` seconds; behind a command that is ``silent``, which has none, a scope needs a
    pause of ``pace`` seconds. Of a ``bare`` one nothing tells that it is complete, and an unanswered command that
    ``leaves_open`` what follows must be closed.
    """

    kind: str | None
    timeout: float
    bare: bool
    pace: float = 0.0
    silent: bool = False
    leaves_open: bool = False


def kind(commands: CommandSet, command: str, once: bool, raw: bool) -> str | None:
    """What an answer may do from one time to the next, by the tables and by how it was asked for.

    What a program is told as the mount has written it is asked again like a state, whatever it is.
    """
    answer = commands.commands[command].answer
    if once or answer == "stream":
        return None
    return answer or ("state" if raw else None)


class Replies(Protocol):
    """How replies are taken apart: the reply at the start of the bytes, or the fault that it is, and its length."""

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None: ...


class PlainReplies:
    def __init__(self, commands: CommandSet) -> None:
        self._commands = commands.commands

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """The reply at the start of the buffer and its length; None while it is incomplete. Raises ValueError."""
        for reply, picture in self._commands[ask.command].replies:
            if (found := picture.matcher.match(buffer)) is not None:
                if reply.fault is not None:
                    return getattr(errors, reply.fault)(), found.end()
                return picture.decode(found[0]), found.end()
        return None


class ReplyRules(Replies, Protocol):
    """How a protocol's requests and replies look on the wire. ``closing`` ends a command of which half was sent.

    It is sent, too, behind an unanswered one that ``leaves_open`` what follows.
    """

    closing: bytes

    def expected(self, ask: Send) -> Expected: ...
    def alike(self, one: Send, other: Send) -> bool: ...
    def as_written(self, command: str, reply: bytes) -> bytes: ...
    def encode(self, ask: Send) -> bytes: ...
    def proof(self, number: int) -> Iterator[Send]: ...
    def proven(self, ask: Send, values: Values) -> bool: ...
