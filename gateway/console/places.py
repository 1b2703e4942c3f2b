"""Names that people type, as places on the sky; catalogues are looked through on a thread of their own."""

from __future__ import annotations

import asyncio
from typing import Any

from gateway.app.control import objects
from gateway.app.control.commands import Body, Spot, Where
from gateway.console.requests import Aimed
from gateway.console.verdict import verdict
from gateway.core import operations as op
from gateway.core.errors import Fault, UserError
from gateway.mount.controller import MountController

#: Names that are suggested while somebody types.
SUGGESTED = 12


class Unknown(Exception):
    """There is no such object or mount; the words say what there is instead."""


async def where(aimed: Aimed) -> Where:
    """The place that is meant. Raises UserError."""
    if aimed.name is not None:
        return await find(aimed.name)
    if aimed.ra is None or aimed.dec is None:
        raise UserError("where to? Give a name, or a right ascension and a declination in degrees")
    return Spot(aimed.ra, aimed.dec, aimed.j2000)


async def find(name: str) -> Where:
    """Raises UserError that says what is like it."""
    return await asyncio.to_thread(objects.find, name)


async def look_up(controller: MountController, name: str) -> dict[str, Any]:
    """An object's places, what it is, and whether the mount may go there. Raises UserError."""
    found = await asyncio.to_thread(objects.describe, name)
    goal = await _goal(controller, found.where)
    return {"name": found.name, "kind": found.kind, "magnitude": found.magnitude, **verdict(controller, goal)}


async def known(text: str) -> list[dict[str, str]]:
    """Objects whose names begin like what was typed so far."""
    found = await asyncio.to_thread(objects.beginning, text, SUGGESTED) if text.strip() else []
    return [{"name": name} for name in found]


async def _goal(controller: MountController, where: Where) -> op.Equatorial:
    """A place of date. Raises UserError."""
    reads: op.Operation
    if isinstance(where, Body):
        reads = op.MoonPlace() if where.name == "Moon" else op.PlanetPlace(where.name)
    elif where.j2000:
        reads = op.OfDate(where.ra, where.dec)
    else:
        return op.Equatorial(where.ra, where.dec)
    try:
        goal: op.Equatorial = await controller.perform(reads)
    except Fault as fault:
        raise UserError(str(fault)) from None
    return goal
