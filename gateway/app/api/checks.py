"""What a Python program hands over is checked here, the same for a gateway inside it and for one that runs already."""

from __future__ import annotations

import asyncio
from math import isfinite
from numbers import Integral, Real
from typing import TypeVar

from msgspec import Struct, ValidationError, convert

from gateway.core import operations as op
from gateway.core import requests
from gateway.core.errors import Invalid

_T = TypeVar("_T")
_S = TypeVar("_S", bound=Struct)
#: Types of fields -> one of their values.
EXAMPLES = {"Direction": "Direction.NORTH", "Rate": "Rate(key=5)", "Tracking": "Tracking.ALTAZ"}


async def find(name: str) -> requests.Where:
    """Return where an object is. Raises Invalid for what is no text, and UserError for a name that is not known."""
    if not isinstance(name, str):
        raise Invalid(f"The name of an object must be a text, not {repr(name)[:40]}.")
    from gateway.app.control import objects  # loads the catalogues

    return await asyncio.to_thread(objects.find, name)


def spot(place: op.Goto | op.Sync, j2000: bool) -> requests.Spot:
    """Return the position of a goto or sync for a request. Raises Invalid."""
    place = _typed(place)
    return requests.Spot(place.ra % 360.0, place.dec, bool(j2000))


def checked_request(request: requests.Request) -> requests.Request:
    """Return a request whose fields have the types that are declared. Raises Invalid for one of another type."""
    if not isinstance(request, requests.Request):
        raise Invalid(f"{repr(request)[:40]} is no request; write one like gateway.core.requests.Home().")
    if isinstance(request, requests.Goto | requests.Sync) and isinstance(request.where, requests.Target):
        _typed(request.where)
    return _typed(request)


def checked(operation: op.Operation[_T]) -> op.Operation[_T]:
    """Return an operation whose fields have the types that are declared. Raises Invalid for one of another type."""
    if not isinstance(operation, op.Operation):
        raise Invalid(f"{repr(operation)[:40]} is no operation; write one like gateway.core.operations.Position().")
    operation = _typed(operation)
    if isinstance(operation, op.SetGuideRate) and not 0.0 <= operation.rate <= 1.0:
        raise Invalid(f"The guide rate must be from 0 to 1, a fraction of sidereal, not {operation.rate:g}.")
    if isinstance(operation, op.Pulse | op.PulseAxis) and operation.ms < 0:
        raise Invalid(f"The duration of a pulse must not be negative, as {operation.ms} is.")
    if operation == op.SetSite():
        raise Invalid("A site needs a latitude, a longitude, or both.")
    return operation


def _typed(value: _S) -> _S:
    """Return a value whose fields have the types that are declared, and are finite. Raises Invalid."""
    kind = type(value)
    fields = {name: _plain(getattr(value, name)) for name in value.__struct_fields__}
    for name, field in fields.items():
        if isinstance(field, float) and not isfinite(field):
            raise Invalid(f"{kind.__name__}: {name}: Expected a number, got {field}.")
    try:
        return convert(fields, kind)
    except ValidationError as error:
        why, _, field = str(error).strip("`").partition(" - at `$.")
        raise Invalid(f"{kind.__name__}: {field}: {why}{_right(kind, field)}.") from None


def _right(kind: type[Struct], field: str) -> str:
    """Return what to write for a field whose type is one of those that programs seldom get right at first."""
    hint = str(kind.__annotations__.get(field, ""))
    return next((f"; write op.{right}" for name, right in EXAMPLES.items() if name in hint), "")


def _plain(value: object) -> object:
    """Return a number of another library as one of Python's own, and everything else as it is."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return value
    return int(value) if isinstance(value, Integral) else float(value)
