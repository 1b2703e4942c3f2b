"""Two mapping tables that only Alpaca has, and faults that only ASCOM defines.

``mappings/alpaca/errors.toml`` has the ASCOM number of each class of fault. ``members.toml`` has the conditions under
which the members of the interface may be used, such as a connected program or an unparked mount.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import msgspec

from gateway.core.errors import Fault, MappingError, Unsupported
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.command_set import load

#: The range of ASCOM's error numbers.
ERROR_NUMBERS = range(0x400, 0x1000)


class NotConnected(Fault):
    """The client has not set Connected to true."""

    default_text = "Not connected: set Connected to true first."


class Parked(Fault):
    """The request needs a mount that is not parked."""

    default_text = "The mount is parked: unpark it first."


class UnreadableMember(Unsupported):
    """The server lacks this member, or could not read it now; its answer does not show which."""


@cache
def number_by_fault() -> dict[str, int]:
    """Return class name of a fault -> ASCOM's error number. Raises MappingError."""
    by_name = {}
    for name, row in load("alpaca").extra_table("errors.toml").items():
        if set(row) != {"number"} or row["number"] not in ERROR_NUMBERS:
            raise MappingError("mappings/alpaca/errors.toml", name, "write number = 0x400 to 0xFFF")
        by_name[name] = int(row["number"])
    return by_name


def error_number(fault: Fault) -> int:
    """Return the error number of a fault: that of its class or of the nearest base class."""
    known = number_by_fault()
    return next(known[kind.__name__] for kind in type(fault).__mro__ if kind.__name__ in known)


def error_members(fault: Fault) -> dict[str, Any]:
    """Return the keys and values of a JSON answer that report a fault."""
    return {"ErrorNumber": error_number(fault), "ErrorMessage": str(fault)}


def error_line(frame: bytes, fault: Fault | None) -> bytes:
    """Return the reply line for a refused request, or (None) for an unknown one."""
    return msgspec.json.encode(error_members(fault or Fault("There is no such member."))) + b"\n"


def is_refusal(reply: bytes) -> bool:
    """Whether a reply line reports an error, by its beginning, which no value has."""
    return reply.startswith(b'{"ErrorNumber"')


# --- conditions of members ----------------------------------------------------------------------------------------


class MemberConditions(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row of ``members.toml``: under which conditions a member of the interface may be used, and its reply."""

    always: bool = False  # programs that are not connected may use it too
    unparked: bool = False  # it is refused while the mount is parked
    tracking: bool | None = None  # it is refused unless the mount tracks (true) or does not track (false)
    arrival: bool = False  # the reply is sent when the goto that it begins has ended
    list: bool = False  # its value is a list


#: The conditions of most members.
DEFAULT_CONDITIONS = MemberConditions()


@cache
def conditions_by_command() -> dict[str, MemberConditions]:
    """Return command name -> the conditions of its member, from ``members.toml``. Raises MappingError."""
    protocol, rows = load("alpaca"), {}
    for name, row in protocol.extra_table("members.toml").items():
        if name not in protocol.commands:
            raise MappingError("mappings/alpaca/members.toml", name, "commands.toml has no such command")
        try:
            rows[name] = msgspec.convert(row, MemberConditions)
        except msgspec.ValidationError as error:
            raise MappingError("mappings/alpaca/members.toml", name, str(error)) from None
    return rows


def conditions_of(name: str) -> MemberConditions:
    """Return the conditions of a command's member."""
    return conditions_by_command().get(name, DEFAULT_CONDITIONS)


#: Field format of a reply -> the value in an answer that reports an error: clients expect one of the member's type.
_EMPTY_BY_FORM: dict[str, Any] = {"truth": False, "number": 0.0, "hours": 0.0, "whole": 0, "moment": "", "json": ""}
_FIELD_FORM = re.compile(r"\{\w+:(\w+)\}")


def empty_value(command: Command) -> dict[str, Any]:
    """Return the key ``Value`` of an error's answer: an empty value of the member's type; {} if it has no value."""
    match = _FIELD_FORM.search(str(command.replies[0][1].source)) if command.replies else None
    if match is None:
        return {}
    return {"Value": [] if conditions_of(command.name).list else _EMPTY_BY_FORM[match[1]]}
