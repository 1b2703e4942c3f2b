"""Operations as values of a request: checked, packed as name and fields, unpacked, and their answers as JSON.

A Python program checks an operation before sending it, so that the error is raised where the mistake was made. The
gateway also checks what it receives, because requests may come from other programs.
"""

from __future__ import annotations

import functools
from math import isfinite
from numbers import Integral, Real
from typing import Any, TypeVar, cast, get_args

import msgspec
from msgspec import Struct, ValidationError, convert

from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import Invalid
from gateway.core.operations import AnswerT

_S = TypeVar("_S", bound=Struct)
#: Types of fields -> an example of their values.
EXAMPLE_VALUES = {"Direction": "Direction.NORTH", "Rate": "Rate(key=5)", "Tracking": "Tracking.ALTAZ"}


def pack_operation(operation: op.Operation[AnswerT], request_number: str) -> requests.OperationRequest:
    """Return the request for an operation. Raises Invalid if it is no operation, or a field is wrong."""
    if not isinstance(operation, op.Operation):
        raise Invalid(f"{repr(operation)[:40]} is not an operation; write one like op.Position().")
    fields: dict[str, Any] = msgspec.to_builtins(_check_ranges(checked_copy(operation)), enc_hook=_to_plain_number)
    return requests.OperationRequest(number=request_number, operation=type(operation).__name__, fields=fields)


def unpack_operation(request: requests.OperationRequest) -> op.Operation[Any]:
    """Return the operation of a request. Raises Invalid if its name or a value is wrong."""
    if (kind := op.operation_class(request.operation)) is None:
        raise Invalid(f"There is no operation {request.operation[:40]!r}.")
    return _check_ranges(_convert_fields(request.fields, kind))


def answer_of(operation: op.Operation[AnswerT], answer_json: str) -> AnswerT:
    """Return the answer to an operation, decoded from JSON."""
    return cast(AnswerT, msgspec.json.decode(answer_json, type=answer_type(type(operation))))


@functools.cache
def answer_type(kind: type[op.Operation]) -> Any:
    """Return the type of the answers to operations of a kind; None for operations without an answer."""
    return get_args(kind.__orig_bases__[0])[0]  # type: ignore[attr-defined]


def checked_copy(value: _S) -> _S:
    """Return a copy with plain Python numbers. Raises Invalid for a field of a wrong type or an infinite number."""
    kind = type(value)
    fields = {name: _to_plain_number(getattr(value, name)) for name in value.__struct_fields__}
    for name, field in fields.items():
        if isinstance(field, float) and not isfinite(field):
            raise Invalid(f"{kind.__name__}: {name}: Expected a number, got {field}.")
    return _convert_fields(fields, kind)


def _convert_fields(fields: dict[str, Any], kind: type[_S]) -> _S:
    try:
        return convert(fields, kind)
    except ValidationError as error:
        why, _, field = str(error).strip("`").partition(" - at `$.")
        raise Invalid(f"{kind.__name__}: {field}: {why}{_expected_form(kind, field)}.") from None


def _check_ranges(operation: op.Operation[AnswerT]) -> op.Operation[AnswerT]:
    """Return the operation. Raises Invalid if a value is out of range."""
    if isinstance(operation, op.SetGuideRate) and not 0.0 <= operation.rate <= 1.0:
        raise Invalid(f"The guide rate must be from 0 to 1, a fraction of sidereal, not {operation.rate:g}.")
    if isinstance(operation, op.Pulse | op.PulseAxis) and operation.ms < 0:
        raise Invalid(f"The duration of a pulse must not be negative, as {operation.ms} is.")
    if operation == op.SetSite():
        raise Invalid("A site needs a latitude, a longitude, or both.")
    return operation


def _expected_form(kind: type[Struct], field: str) -> str:
    """Return a hint how to write a field whose type programs often get wrong; empty for other fields."""
    hint = str(kind.__annotations__.get(field, ""))
    return next((f"; write op.{right}" for name, right in EXAMPLE_VALUES.items() if name in hint), "")


def _to_plain_number(value: object) -> object:
    """Convert a number of another library to Python's type; return everything else unchanged."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)
