"""Refusals that ASCOM has and no mount, and the number of each: ``mappings/alpaca/errors.toml``."""

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
