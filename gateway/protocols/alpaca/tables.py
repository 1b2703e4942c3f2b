"""The two further tables of Alpaca, and the refusals that ASCOM has and no mount.

``mappings/alpaca/errors.toml`` has the number of each kind of refusal, ``members.toml`` what a member of the interface
needs besides its operations: a connected program, a mount in service.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import msgspec

from gateway.core.errors import Fault, MappingError
from gateway.protocols.wireformat.command_set import load

#: The numbers that ASCOM has for errors.
NUMBERS = range(0x400, 0x1000)


class NotConnected(Fault):
    """This program has not connected."""

    words = "Not connected: set Connected to true first."


class Parked(Fault):
    """What is asked for takes a mount that is not parked."""

    words = "The mount is parked: unpark it first."


@cache
def numbers() -> dict[str, int]:
    """Kind of refusal -> number. Raises MappingError."""
    found = {}
    for name, row in load("alpaca").extra("errors.toml").items():
        if set(row) != {"number"} or row["number"] not in NUMBERS:
            raise MappingError("mappings/alpaca/errors.toml", name, "write number = 0x400 to 0xFFF")
        found[name] = int(row["number"])
    return found


def number(fault: Fault) -> int:
    """The number of a refusal: its own, or that of what it is a kind of."""
    known = numbers()
    return next(known[kind.__name__] for kind in type(fault).__mro__ if kind.__name__ in known)


def refused(fault: Fault) -> dict[str, Any]:
    """An answer that says no."""
    return {"ErrorNumber": number(fault), "ErrorMessage": str(fault)}


def refusal(frame: bytes, fault: Fault | None) -> bytes:
    """The answer to a request that is not carried out, or that nobody has."""
    return msgspec.json.encode(refused(fault or Fault("There is no such member."))) + b"\n"


def is_refusal(reply: bytes) -> bool:
    """Whether a line is such an answer: no value looks so."""
    return reply.startswith(b'{"ErrorNumber"')


# --- what a member needs ------------------------------------------------------------------------------------------


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
