"""What the mount link must know of a protocol to exchange commands: how requests are encoded and replies parsed.

``PlainReplies`` parses replies by the tables alone, for the log and ``decode``, if no mount speaks the protocol.
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

#: Seconds without another byte after which a reply is complete that could also be the beginning of a longer reply.
ALONE = 0.3


class Expected(NamedTuple):
    """What is known of a reply before it arrives."""

    #: How the value may change between two requests (``Answer``); None if the reply is accepted unverified.
    answer_kind: str | None
    timeout: float  # how many seconds the reply may take
    unterminated: bool  # the reply has no terminator, so that nothing shows that it is complete
    delay_after: float = 0.0  # the pause in seconds that the mount needs after a ``silent`` command
    silent: bool = False  # the command has no reply
    leaves_open: bool = False  # if no reply arrives, ``ReplyRules.closing`` must be sent before anything else
    #: Replies that may also begin a longer one: complete if nothing follows for ``ALONE`` seconds.
    beginnings: frozenset[bytes] = frozenset()
    #: On a wire that delivers only the newest reply: how many seconds a stop waits for this reply before it is sent.
    gives_way: float = math.inf


def answer_kind(commands: CommandSet, command: str, once: bool, raw: bool) -> str | None:
    """Return how the value in a reply may change between two requests (``Answer``); None: accept it unverified.

    A raw reply, which a client receives exactly as the mount sent it, is verified like a ``state``.
    """
    answer = commands.commands[command].answer
    if once or answer == "stream":
        return None
    return answer or ("state" if raw else None)


class Replies(Protocol):
    """Parses the replies of a mount."""

    @property
    def protocol(self) -> CommandSet:
        """The commands of the mount, in its dialect if that is known."""

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the values or the fault of the reply that the buffer begins with, and its length; None: incomplete."""


class PlainReplies:
    """Parses the replies of a protocol by its tables alone."""

    def __init__(self, commands: CommandSet) -> None:
        self.protocol = commands

    def take(self, ask: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the first reply in the buffer and its length; None if it is incomplete. Raises ValueError for a field
        that is out of range.
        """
        for reply, template in self.protocol.commands[ask.command].replies:
            if (match := template.matcher.match(buffer)) is not None:
                if reply.fault is not None:
                    return getattr(errors, reply.fault)(), match.end()
                return template.decode(match[0]), match.end()
        return None


class ReplyRules(Replies, Protocol):
    """How a protocol's requests and replies look on the wire."""

    #: The bytes that end a partly sent command, so that the mount does not join it with the next.
    closing: bytes
    #: The bytes that some mounts send before or after a reply, and that are no part of it.
    padding: bytes

    def as_written(self, command: str, reply: bytes) -> bytes:
        """Return a reply of the gateway in the mount's notation; unchanged if the protocol has a single notation."""
        return reply

    def encode(self, ask: Send) -> bytes:
        """Return the bytes of a request. Raises Refused for a value that the field cannot hold."""
        try:
            return self.protocol.commands[ask.command].request.encode(ask.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def expected(self, ask: Send) -> Expected:
        """Return what is known of the reply to this request before it arrives."""

    def ambiguous_with(self, sent: Send, other: Send) -> bool:
        """Whether the replies to two commands are so similar in form that they could be confused."""

    def resync_commands(self, number: int) -> Iterator[Send]:
        """Yield commands whose replies prove that replies match requests again; ``number`` counts these checks."""

    def is_resync_reply(self, ask: Send, values: Values) -> bool:
        """Whether these values are the right reply to a command of ``resync_commands``."""
