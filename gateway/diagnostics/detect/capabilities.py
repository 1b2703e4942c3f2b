"""How the gateway will go about things on a mount: the driver's rows, narrowed to what this version has."""

from __future__ import annotations

from typing import NamedTuple

from gateway.core import operations as op
from gateway.protocols.base.driver import Driver
from gateway.protocols.registry import PROTOCOLS


class Row(NamedTuple):
    """``none``: the words for a mount that has none of the commands that its protocol has for it."""

    name: str
    operation: type[op.Operation]
    none: str


ROWS = (
    Row("coordinates", op.Position, ""),
    Row("tracking", op.SetTracking, "left to the mount"),
    Row("sync", op.Sync, "the gateway's offset"),
    Row("arrows", op.Move, "small gotos"),
    Row("site", op.GetSite, "its GPS unit, or --site"),
    Row("clock", op.GetClock, "its GPS unit or this computer's"),
)


def ways(driver: Driver) -> dict[str, str]:
    """What is done -> by which commands, or by what in their place. The driver must have identified its mount."""
    found = {}
    for row in ROWS:
        way = driver.way(row.operation)
        if way is not None:
            first = PROTOCOLS[driver.protocol.name].capabilities.get(row.name, {})
            known = [name for name in first if name in way.commands and driver.knows(name)]
            found[row.name] = first[known[0]] if known else row.none
    if not getattr(driver, "tells_status", True):
        found["tracking"] = "left to the mount"  # a Meade without :GW# would lose its alignment over :AL#
    return found
