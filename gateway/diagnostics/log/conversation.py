"""Describe the commands and replies of a connection in sentences, whose parts come from the command tables.

A live gateway passes complete frames; a raw capture is split into frames here, with the framer of the surface. A reply
is parsed as a driver parses it: according to the command that it answers.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from gateway.app.bindings import framer_and_parser
from gateway.core.errors import Fault, Refused
from gateway.diagnostics.log.words import constant_values, format_fields
from gateway.protocols.base.driver import Send
from gateway.protocols.base.frames import Unterminated
from gateway.protocols.wireformat.command_set import load

#: The greatest number of unanswered commands, and of bytes that are not a complete reply yet.
MAX_UNANSWERED, MAX_UNPARSED_BYTES = 256, 4096


class DecodedMessage(NamedTuple):
    """A decoded command or reply, its description, and the command's name in the command table (empty if unknown).

    ``is_query``: a query that changes nothing, or its reply. ``fails``: refused, or not understood. ``fields``
    are all fields of a reply by name; ``steady_values`` are those that stay constant while nothing happens (no
    positions, no times). ``pushed``: a message that answers no request.
    """

    data: bytes
    text: str
    command: str = ""
    is_query: bool = False
    fails: bool = False
    steady_values: tuple[object, ...] = ()
    fields: Mapping[str, object] = MappingProxyType({})
    pushed: bool = False


def _short_meaning(meaning: str) -> str:
    """Return a short description of a command, without the further explanations of the manual."""
    return re.split(r"[:;] | \(", meaning)[0]


class ConnectionDecoder:
    """Decodes one connection (a client's or the mount's), and remembers commands that are still unanswered."""

    def __init__(self, protocol: str, model: str | None = None) -> None:
        framing, self._reply_rules = framer_and_parser(protocol, model)
        self.protocol, self._framer = protocol, framing()
        self._requests: deque[Send] = deque(maxlen=MAX_UNANSWERED)
        self._partial_reply = b""
        #: The messages of this protocol that are sent without a request.
        self._pushed = [Send(name) for name, command in load(protocol).commands.items() if command.pushed is not None]

    # --- commands ---------------------------------------------------------------------------------------------------

    def decode_commands(self, data: bytes, time: float) -> Iterator[DecodedMessage]:
        """Yield the commands that these bytes complete. ``time`` is when they arrived, in seconds."""
        for frame in self._framer.feed(data, time):
            yield self.describe_command(frame)

    def describe_command(self, frame: bytes) -> DecodedMessage:
        """Describe a complete command; the next matching reply is its answer."""
        if isinstance(frame, Unterminated):
            self._requests += [Send(name) for name in frame.command_names[:1] if name and not frame.late]
            return DecodedMessage(
                frame,
                "its end (#) is missing: refused",
                frame.command_names[0] if frame.command_names else "",
                fails=True,
            )
        match = self._reply_rules.protocol.find(frame)
        if match is None:
            return DecodedMessage(frame, f"not a command of the {self.protocol} protocol", fails=True)
        command, picture = match
        try:
            values = picture.decode(frame)
        except ValueError as error:
            if command.replies:
                self._requests.append(Send(command.name))
            return DecodedMessage(frame, f"{command.help}; not valid: {error}", command.name, fails=True)
        if command.replies:
            self._requests.append(Send(command.name, values))
        fields = format_fields(self.protocol, command.name, values)
        text = f"{_short_meaning(command.help)}: {fields}" if fields else _short_meaning(command.help)
        return DecodedMessage(frame, text, command.name, command.is_query)

    # --- replies ----------------------------------------------------------------------------------------------------

    def decode_replies(self, data: bytes) -> Iterator[DecodedMessage]:
        """Yield the replies that these bytes complete, each matched to the oldest command that it can answer."""
        self._partial_reply += data
        while self._partial_reply:
            taken = self._match_reply()
            if taken is None and len(self._partial_reply) <= MAX_UNPARSED_BYTES:
                break
            if taken is None:
                taken = DecodedMessage(b"", "answers no request", fails=True), len(self._partial_reply)
            message, length = taken
            yield message._replace(data=self._partial_reply[:length])
            self._partial_reply = self._partial_reply[length:]

    def _match_reply(self) -> tuple[DecodedMessage, int] | None:
        """Match the bytes to the oldest command that they can answer, and forget older ones. None: they are too few."""
        for skipped, ask in enumerate(self._requests):
            taken = self._parse_reply(ask, self._partial_reply)
            if taken is not None and taken[1]:
                for _ in range(skipped + 1):
                    self._requests.popleft()
                return self._describe(ask, *taken)
        if (message := self._match_pushed(self._partial_reply)) is not None:
            return message
        if self._requests or self._pushed:
            return None
        return DecodedMessage(b"", "nobody asked", fails=True), len(self._partial_reply)

    def describe_reply_to_last(self, data: bytes) -> DecodedMessage:
        """Describe a complete reply to the last command, on a connection with one request at a time. The text is empty
        if the reply does not match that command.
        """
        if (message := self._match_pushed(data)) is not None:
            return message[0]._replace(data=data)
        ask = self._requests[-1] if self._requests else None
        self._requests.clear()
        taken = self._parse_reply(ask, data) if ask is not None else None
        if ask is None or taken is None:
            return DecodedMessage(data, "")
        return self._describe(ask, *taken)[0]._replace(data=data)

    def _match_pushed(self, data: bytes) -> tuple[DecodedMessage, int] | None:
        """Describe the bytes if they are a message that is sent without a request; else return None."""
        for pushed in self._pushed:
            taken = self._parse_reply(pushed, data)
            if taken is not None:
                message, length = self._describe(pushed, *taken)
                return message._replace(pushed=True), length
        return None

    def _parse_reply(self, request: Send, data: bytes) -> tuple[dict[str, object] | Fault, int] | None:
        try:
            return self._reply_rules.parse_reply(request, data)
        except ValueError as error:
            return Refused(f"garbled: {error}"), len(data)

    def _describe(self, request: Send, reply: dict[str, object] | Fault, length: int) -> tuple[DecodedMessage, int]:
        command = self._reply_rules.protocol.commands[request.command]
        if isinstance(reply, Fault):
            return DecodedMessage(b"", f"{command.name}: {reply}", command.name, fails=True), length
        values = {key: value for key, value in reply.items() if key != "length"}
        text = format_fields(self.protocol, command.name, values) or "accepted"
        lasting = constant_values(self.protocol, command.name, values)
        message = DecodedMessage(
            b"", f"{command.name}: {text}", command.name, command.is_query, steady_values=lasting, fields=values
        )
        return message, length
