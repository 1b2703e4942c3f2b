"""The functions that rows of ``mappings/lx200/surface.toml`` call, by the word in the row."""

from __future__ import annotations

from gateway.protocols.base.surface import Special
from gateway.protocols.lx200.surface import (
    accessories,
    clock,
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

HANDLERS: dict[str, Special] = {"own_library": own.own_library} | {
    name: function
    for module in (accessories, clock, help, moon, motion, objects, search, site, target, tracking)
    for name, function in vars(module).items()
    if callable(function) and getattr(function, "__module__", "") == module.__name__ and not name.startswith("_")
}
