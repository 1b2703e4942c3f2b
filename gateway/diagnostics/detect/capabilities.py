"""How the gateway will go about things on a mount: the driver's rows, narrowed to what this version has."""

from __future__ import annotations

from typing import NamedTuple

from gateway.core import operations as op
from gateway.protocols.base.driver import Driver


class Row(NamedTuple):
    """``first``: the words for the first of these commands that the mount has; ``none``: where it has none of them."""

    name: str
    operation: type[op.Operation]
    first: dict[str, str]
    none: str


ROWS = (
    Row("coordinates", op.Position, {"e": "precise (e, r)", "E": "16 bits (E, R)", "GR": ":GR# :GD#"}, ""),
    Row("tracking", op.SetTracking, {"T": "T", "AP": ":AL# and back"}, "left to the mount"),
    Row("sync", op.Sync, {"s": "s", "CM": ":CM#"}, "the gateway's offset"),
    Row("arrows", op.Move, {"slew_azm_pos": "P", "Mn": ":Mn# :Ms# :Me# :Mw#"}, "small gotos"),
    Row("site", op.GetSite, {"w": "w", "Gt": ":Gt# :Gg#"}, "its GPS unit, or --site"),
    Row("clock", op.GetClock, {"i": "i", "h": "h", "GL": ":GL# :GC# :GG#"}, "its GPS unit or this computer's"),
)  # fmt: skip


def ways(driver: Driver) -> dict[str, str]:
    """What is done -> by which commands, or by what in their place. The driver must have identified its mount."""
    found = {}
    for row in ROWS:
        way = driver.way(row.operation)
        if way is not None:
            known = [name for name in row.first if name in way.commands and driver.knows(name)]
            found[row.name] = row.first[known[0]] if known else row.none
    if not getattr(driver, "tells_status", True):
        found["tracking"] = "left to the mount"  # a Meade without :GW# would lose its alignment over :AL#
    return found
