"""What a member needs besides its operations: the rows of ``mappings/alpaca/members.toml``."""

from __future__ import annotations

from functools import cache

import msgspec

from gateway.core.errors import MappingError
from gateway.protocols.wireformat.command_set import load


class Member(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """``always``: for programs that are not connected, too. ``unparked``: not while the mount is parked. ``tracking``:
    only while it tracks, or only while it does not. ``arrival``: answered when the goto that it begins is over.
    """

    always: bool = False
    unparked: bool = False
    tracking: bool | None = None
    arrival: bool = False


#: What most members need.
PLAIN = Member()


@cache
def members() -> dict[str, Member]:
    """By command. Raises MappingError."""
    protocol, rows = load("alpaca"), {}
    for name, row in protocol.extra("members.toml").items():
        if name not in protocol.commands:
            raise MappingError("mappings/alpaca/members.toml", name, "commands.toml has no such command")
        try:
            rows[name] = msgspec.convert(row, Member)
        except msgspec.ValidationError as error:
            raise MappingError("mappings/alpaca/members.toml", name, str(error)) from None
    return rows


def member(name: str) -> Member:
    """What this command needs."""
    return members().get(name, PLAIN)
