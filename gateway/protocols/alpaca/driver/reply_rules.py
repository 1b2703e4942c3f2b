"""How requests to an Alpaca telescope look as text lines, and what the lines of its answers mean.

HTTP matches each answer to its request, so no answer is verified by a second request. If the server reports that the
telescope is not connected, the line counts as lost until the telescope is connected again.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any

from gateway.core import errors
from gateway.core.errors import Fault, Invalid, NoAnswer, Refused
from gateway.core.operations import Values
from gateway.protocols.alpaca.tables import NotConnected, Parked, UnreadableMember, number_by_fault
from gateway.protocols.base.driver import Send
from gateway.protocols.base.reply_rules import ExpectedReply, ReplyRules
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet, load
from gateway.protocols.wireformat.fields import CODECS

#: Seconds that an answer may take; seconds that a stop waits for the answer to an earlier order.
REPLY_TIMEOUT, MAX_STOP_WAIT = 5.0, 0.3
#: Error numbers that some servers send for any failure, and (ASCOM: invalid value) for a value that they do not have.
GENERAL_ERROR, INVALID_VALUE = 1, 0x401


class AlpacaReplyRules(ReplyRules):
    """Encodes the requests to an Alpaca telescope, parses its answers, and notes whether it is still connected."""

    protocol: CommandSet = load("alpaca")
    #: HTTP delivers no partial requests, so ``half_command_end`` is a blank line, which has no meaning.
    half_command_end, ignored_bytes = b"\n", b""

    def __init__(self) -> None:
        self._mount_disconnected = False

    def expected_reply(self, request: Send) -> ExpectedReply:
        question = self.protocol.commands[request.command].is_query
        return ExpectedReply(None, REPLY_TIMEOUT, unterminated=False, max_stop_wait=0.0 if question else MAX_STOP_WAIT)

    def ambiguous_with(self, sent: Send, other: Send) -> bool:
        return False

    def parse_reply(self, request: Send, buffer: bytes) -> tuple[Values | Fault, int] | None:
        """Return the answer that the buffer begins with and its length; None while it is incomplete.

        Raises ValueError for a value of the wrong type.
        """
        line, end, _ = buffer.partition(b"\n")
        if not end:
            return None
        answer, command = json.loads(line), self.protocol.commands[request.command]
        if isinstance(answer, dict) and "ErrorNumber" in answer:
            return self._to_fault(command, int(answer["ErrorNumber"]), str(answer["ErrorMessage"])), len(line) + 1
        return _reply_values(command, answer), len(line) + 1

    def _to_fault(self, command: Command, number: int, text: str) -> Fault:
        if number in (GENERAL_ERROR, INVALID_VALUE) and command.is_query and not command.request.fields:
            return UnreadableMember(text)  # nothing was given that could be invalid
        kind = _fault_by_number().get(number, Refused)
        if kind is NotConnected:
            self._mount_disconnected = True
            return NoAnswer(f"The server has lost the mount: {text}")
        return kind(text or f"The server reports error 0x{number:X}, without a text.")

    def resync_commands(self, check_number: int) -> Iterator[Send]:
        """Yield the commands whose replies show that the telescope can be used again."""
        if self._mount_disconnected:
            yield Send("set_connected", {"on": True})
        yield Send("connected")

    def is_resync_reply(self, request: Send, values: Values) -> bool:
        if request.command == "connected":
            self._mount_disconnected = not values["value"]
            return bool(values["value"])
        return True


@cache
def _fault_by_number() -> dict[int, type[Fault]]:
    """Return ASCOM's error number -> class of fault; all other numbers are ``Refused``."""
    named: dict[str, type[Fault]] = {"NotConnected": NotConnected, "Parked": Parked}
    several = [Invalid.__name__, "NoTarget", "Unsupported", *named]
    return {number_by_fault()[name]: named.get(name) or getattr(errors, name) for name in several}


def _reply_values(command: Command, value: Any) -> Values | Fault:
    """Return a value under its field's name; UnreadableMember for null in a GET. Raises ValueError for a wrong type."""
    if value is None and command.is_query:
        return UnreadableMember("The server gives no value.")
    for name, codec in command.replies[0][1].fields.items():
        if codec is CODECS["truth"] and value in (0, 1):  # False and True are among these
            return {name: bool(value)}
        text = value if isinstance(value, str) and codec is not CODECS["json"] else json.dumps(value)
        return {name: codec.decode(text.encode())}
    return {}
