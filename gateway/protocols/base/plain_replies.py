"""Replies taken apart by the tables alone, for a protocol that is never spoken to a mount: the log and ``decode``."""

from __future__ import annotations

from gateway.core import errors
from gateway.core.errors import Fault
from gateway.core.operations import Values
from gateway.protocols.base.driver import Send
from gateway.protocols.wireformat.command_set import CommandSet


class PlainReplies:
    """The replies of one protocol."""

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
