"""The LX200 surface: what its rows in ``mappings/lx200/surface.toml`` call."""

from __future__ import annotations

from gateway.protocols.base.surface import Special
from gateway.protocols.lx200.surface import (
    accessories,
    clock,
    gps,
    help,
    moon,
    motion,
    objects,
    own,
    search,
    site,
    target,
    tracking,
)

_SEVERAL: dict[str, Special] = {
    "gps_sentence": gps.sentence, "gps_clock": gps.set_clock, "own_library": own.own_library,
}  # fmt: skip
HANDLERS: dict[str, Special] = _SEVERAL | {
    name: function
    for module in (accessories, clock, help, moon, motion, objects, search, site, target, tracking)
    for name, function in vars(module).items()
    if callable(function) and getattr(function, "__module__", "") == module.__name__ and not name.startswith("_")
}
