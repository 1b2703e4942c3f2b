"""What the mount link must know of a protocol to exchange commands: the forms of requests and replies.

``PlainReplies`` decodes a protocol that only programs speak by the tables alone, for the log and for ``decode``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, Protocol

from gateway.core import errors
from gateway.core.errors import Fault, Refused
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.wireformat.command_set import CommandSet

#: Seconds without another byte that make a digit a whole reply, of a mount that may send a text after it.
ALONE = 0.3


class Expected(NamedTuple):
    """What is known of a reply before it arrives.

    answer_kind   how the answer may change between two requests; None if it is accepted without verification
    timeout       how many seconds the reply may take
    unterminated  the reply has no terminator, so that nothing shows that it is complete
    delay_after   the pause in seconds that the mount needs after a ``silent`` command
    silent        the command has no reply
    leaves_open   if the command stays unanswered, ``ReplyRules.closing`` must be sent before anything else
    beginnings    replies that are also the beginning of a longer reply: nothing must follow them for ``ALONE`` seconds
    gives_way     after so many seconds a stop that waits is sent, on a wire that delivers only the newest reply
    """

    answer_kind: str | None
    timeout: float
    unterminated: bool
    delay_after: float = 0.0
    silent: bool = False
    leaves_open: bool = False
    beginnings: frozenset[bytes] = frozenset()
    gives_way: float = math.inf


def answer_kind(commands: CommandSet, command: str, once: bool, raw: bool) -> str | None:
    """Return how the answer to a command may change: a word of ``Answer``, or None to accept it without verification.

    A raw reply, which a client receives as the mount has written it, is verified like a state.
    """
    answer = commands.commands[command].answer
    if once or answer == "stream":
        return None
    return answer or ("state" if raw else None)


class Replies(Protocol):
    """Parses replies: ``take`` returns the values or the fault of the reply that begins the buffer, and its length.

    ``protocol`` has the commands of the mount, as far as its dialect is known.
    """

    @property
    def protocol(self) -> CommandSet: ...

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None: ...


class PlainReplies:
    def __init__(self, commands: CommandSet) -> None:
        self.protocol = commands

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the first reply in the buffer and its length; None if incomplete. ValueError: a field out of range."""
        for reply, template in self.protocol.commands[ask.command].replies:
            if (match := template.matcher.match(buffer)) is not None:
                if reply.fault is not None:
                    return getattr(errors, reply.fault)(), match.end()
                return template.decode(match[0]), match.end()
        return None


class ReplyRules(Replies, Protocol):
    """How a protocol's requests and replies look on the wire.

    ``closing`` are the bytes that end a half-sent command, and an unanswered command that ``leaves_open``; ``padding``
    are those that some mounts send before and after a reply, and that are no part of it.
    """

    closing: bytes
    padding: bytes

    def as_written(self, command: str, reply: bytes) -> bytes:
        """Return a reply as the mount writes it: by default in the only notation of the protocol."""
        return reply

    def encode(self, ask: Send) -> bytes:
        """Return the bytes of a request. Raises Refused for a value that the field cannot hold."""
        try:
            return self.protocol.commands[ask.command].request.encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def expected(self, ask: Send) -> Expected: ...
    def ambiguous_with(self, sent: Send, other: Send) -> bool: ...
    def resync_commands(self, number: int) -> Iterator[Send]: ...
    def is_resync_reply(self, ask: Send, values: Values) -> bool: ...
