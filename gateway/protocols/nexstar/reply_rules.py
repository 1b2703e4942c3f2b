"""How requests to a hand control are encoded, and how its replies are framed and decoded.

The template of a reply gives its length, because ``#`` is a legal data byte. If the device behind a pass-through
command did not answer, the reply has one extra byte before the ``#`` (NexStar protocol, Pass-through Commands with No
Response). This module checks the form of a single reply; the mount link checks whether its value is plausible.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

from gateway.core.errors import Fault, Garbled, NoDevice
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ExpectedReply, ReplyRules, answer_kind
from gateway.protocols.wireformat.command import FrameTemplate
from gateway.protocols.wireformat.command_set import CommandSet, load

#: At most how many extra bytes a StarSense sends in its reply to ``t``.
MAX_EXTRA_BYTES = {"t": 4}
#: Printable bytes for echo requests. None is ``#``; consecutive resynchronisations use different ones.
ECHO_BYTES = range(0x40, 0x7E)
#: Seconds that a hand control may take to answer (Developer Notes, Timeouts). It takes all of them if it passes a
#: command to a missing device, so the gateway waits a little longer.
TIMEOUT, LINE_ALLOWANCE = 3.5, 0.5


PROTOCOL = load("nexstar")


class _ReplyForm(NamedTuple):
    """The reply to a command: its template, its usual and longest length, and whether a device on the bus answers.

    ``long_template`` is the longer form of another maker's hand controls; None if there is none.
    """

    template: FrameTemplate
    usual_length: int
    max_length: int
    passed_through: bool
    long_template: FrameTemplate | None


@cache
def _reply_form(command: str) -> _ReplyForm:
    row = PROTOCOL.commands[command]
    *others, template = [form for _, form in row.replies]
    long_template = others[0] if others else None
    assert template.length is not None
    passed_through = row.request.prefix.startswith(b"P")
    longest = (long_template or template).length or 0
    longest += 1 if passed_through else MAX_EXTRA_BYTES.get(command, 0)
    return _ReplyForm(template, template.length, longest, passed_through, long_template)


class NexStarReplyRules(ReplyRules):
    """The reply rules of the NexStar protocol (see ``protocols/base/reply_rules.py``)."""

    protocol: CommandSet = PROTOCOL
    half_command_end = ignored_bytes = b""

    def expected_reply(self, request: Send) -> ExpectedReply:
        """Return what reply to expect: every command has one; it may be ``#`` alone."""
        return _expected_reply(request.command, request.once, request.include_raw)

    def ambiguous_with(self, sent: Send, other: Send) -> bool:
        """Whether the replies to two commands could be confused. Only their lengths distinguish them."""
        first, second = _reply_form(sent.command), _reply_form(other.command)
        return first.usual_length <= second.max_length and second.usual_length <= first.max_length

    def parse_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the reply (or fault) at the start of the buffer and its length; None while it is incomplete.

        The fault is NoDevice or Garbled. Raises ValueError for a field that cannot be decoded.
        """
        template, width, longest, passed_through, long_template = _reply_form(request.command)
        if len(buffer) < width:
            return None
        if buffer[width - 1 : width] == b"#":
            return template.decode(buffer[:width]), width
        end = buffer.find(b"#", width, longest)
        if end < 0:
            return None if len(buffer) < longest else (Garbled(), len(buffer))
        if passed_through:
            return NoDevice(), end + 1
        if long_template is not None:
            return long_template.decode(buffer[: end + 1]), end + 1
        return template.decode(buffer[: width - 1] + b"#"), end + 1

    def resync_commands(self, check_number: int) -> Iterator[Send]:
        """Yield the requests that show whether replies are in step: two echoes of bytes that were not used recently."""
        for step in (2 * check_number, 2 * check_number + 1):
            yield Send("K", {"echo": ECHO_BYTES[step % len(ECHO_BYTES)]})

    def is_resync_reply(self, request: Send, values: Values) -> bool:
        return bool(values.get("echo") == request.values["echo"])


@cache
def _expected_reply(command: str, once: bool, raw: bool) -> ExpectedReply:
    reply = _reply_form(command)
    timeout = TIMEOUT + LINE_ALLOWANCE if reply.passed_through else TIMEOUT
    return ExpectedReply(answer_kind(PROTOCOL, command, once, raw), timeout, unterminated=reply.usual_length == 1)
