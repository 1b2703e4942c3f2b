"""What the mount link needs of a protocol to exchange commands: how requests are encoded and replies parsed.

``TableReplyParser`` parses replies by the tables alone, for the log and ``decode``, if no mount speaks the protocol.
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

#: A reply that could also begin a longer one is complete after so many seconds without another byte.
REPLY_END_GAP = 0.3


class ExpectedReply(NamedTuple):
    """What is known of a reply before it arrives."""

    #: How the value may change between two requests (``AnswerKind``); None if the reply is accepted unverified.
    answer_kind: str | None
    timeout: float  # how many seconds the reply may take
    unterminated: bool  # the reply has no terminator, so that nothing shows that it is complete
    delay_after: float = 0.0  # the pause in seconds that the mount needs after a ``silent`` command
    silent: bool = False  # the command has no reply
    needs_command_end: bool = False  # if no reply arrives, ``half_command_end`` must be sent before anything else
    #: Replies that may also begin a longer one: complete if nothing follows for ``REPLY_END_GAP`` seconds.
    ambiguous_replies: frozenset[bytes] = frozenset()
    #: On a wire that delivers only the newest reply: how many seconds a stop waits for this reply before it is sent.
    max_stop_wait: float = math.inf


def answer_kind(commands: CommandSet, command: str, asked_once: bool, is_raw: bool) -> str | None:
    """Return how the value in a reply may change between two requests (``AnswerKind``); None: accept it unverified. A
    raw reply, which a client receives exactly as the mount sent it, is verified like a ``state``.
    """
    answer = commands.commands[command].answer_kind
    if asked_once or answer == "stream":
        return None
    return answer or ("state" if is_raw else None)


class ReplyParser(Protocol):
    """Parses the replies of a mount."""

    @property
    def protocol(self) -> CommandSet:
        """The commands of the mount, in its dialect if that is known."""

    def parse_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the values or the fault of the first reply in the buffer, and its length; None if incomplete."""


class TableReplyParser:
    """Parses the replies of a protocol by its tables alone."""

    def __init__(self, commands: CommandSet) -> None:
        self.protocol = commands

    def parse_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the first reply and its length; None if incomplete. Raises ValueError for a field out of range."""
        for reply, template in self.protocol.commands[request.command].replies:
            if (match := template.matcher.match(buffer)) is not None:
                if reply.fault is not None:
                    return getattr(errors, reply.fault)(), match.end()
                return template.decode(match[0]), match.end()
        return None


class ReplyRules(ReplyParser, Protocol):
    """How a protocol's requests and replies look on the wire."""

    #: The bytes that end a partly sent command, so that the mount does not join it with the next.
    half_command_end: bytes
    #: The bytes that some mounts send before or after a reply, and that are no part of it.
    ignored_bytes: bytes

    def in_mount_notation(self, command: str, reply: bytes) -> bytes:
        """Return a reply of the gateway in the mount's notation; unchanged if the protocol has a single notation."""
        return reply

    def encode(self, request: Send) -> bytes:
        """Return the bytes of a request. Raises Refused for a value that the field cannot hold."""
        try:
            return self.protocol.commands[request.command].request.encode(request.values)
        except ValueError as error:
            raise Refused(str(error)) from None

    def expected_reply(self, request: Send) -> ExpectedReply:
        """Return what is known of the reply to this request before it arrives."""

    def ambiguous_with(self, sent: Send, other: Send) -> bool:
        """Whether the replies to two commands are so similar in form that they could be confused."""

    def resync_commands(self, check_number: int) -> Iterator[Send]:
        """Yield the commands of resynchronisation ``check_number``, to check that replies match requests again."""

    def is_resync_reply(self, request: Send, values: Values) -> bool:
        """Whether these values are the right reply to a command of ``resync_commands``."""
