"""Between the tables and values: what an operation needs, what a reply form is filled with, and the form for no."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import msgspec

from gateway.core.errors import Fault
from gateway.core.operations import Operation
from gateway.protocols.wireformat.command import Command


def refusal(command: Command, fault: Fault) -> bytes:
    """The reply form that stands for this fault, else the first that stands for any, else silence."""
    refusals = [(reply, picture) for reply, picture in command.replies if reply.fault is not None]
    name = type(fault).__name__
    chosen = next((item for item in refusals if item[0].fault == name), refusals[0] if refusals else None)
    if chosen is None:
        return b""
    return chosen[1].encode(dict.fromkeys(chosen[1].fields, str(fault)))


@cache
def needs(kind: type[Operation]) -> tuple[tuple[str, bool], ...]:
    """The fields of an operation, and whether each must be given; looking them up costs more than all of a reply."""
    return tuple((field.name, field.required) for field in msgspec.structs.fields(kind))


def fields_of(answer: object, names: Mapping[str, object]) -> Mapping[str, object]:
    """An answer as the fields a reply wants: a mapping, a struct, or one bare value for one field."""
    if isinstance(answer, Mapping):
        return answer
    if isinstance(answer, msgspec.Struct):
        return msgspec.structs.asdict(answer)
    return dict.fromkeys(names, answer)
