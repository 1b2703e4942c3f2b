"""The commands that end motions, by the tables: what is understood of them before they have their turn, or are whole.

That a command ends something is said once, beside the command (``urgent`` in ``commands.toml``), and which operation it
is in its row of ``surface.toml``. Whoever must know before its turn asks here.
"""

from __future__ import annotations

import re
from functools import cached_property
from typing import NamedTuple

from gateway.core.operations import Operation
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import CommandSet

#: What is done in the moment in which it comes.
AT_ONCE = ("stop", "restart", "axis")


class Ending(NamedTuple):
    """What a command ends in the moment in which it comes, and the commands that do not get their turn any more."""

    operation: Operation
    takes_back: frozenset[bytes]


class Ends:
    """The ends of one protocol."""

    def __init__(self, protocol: CommandSet) -> None:
        self._protocol = protocol

    @cached_property
    def at_once(self) -> dict[bytes, Command]:
        """The commands that end something in the moment in which they come, by their frames."""
        urgent = [command for command in self._protocol.commands.values() if command.urgent in AT_ONCE]
        return {command.request.literal: command for command in urgent if command.name in self._protocol.surface}

    def takes_back(self, command: Command) -> frozenset[bytes]:
        """The commands that do not get their turn any more when it comes."""
        return frozenset([self._protocol.commands[name].request.literal for name in command.takes_back])

    @cached_property
    def _mark(self) -> re.Pattern[bytes] | None:
        marks = {command.mark for command in self._protocol.commands.values() if command.urgent}
        return re.compile(b"|".join(map(re.escape, sorted(marks)))) if marks else None

    def may_be_in(self, data: bytes) -> bool:
        """Whether these bytes, which are not cut into commands yet, may be or hold the end of a motion."""
        return self._mark is not None and self._mark.search(data) is not None
