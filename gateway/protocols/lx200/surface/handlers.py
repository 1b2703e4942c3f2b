"""The functions that rows of ``mappings/lx200/surface.toml`` call, by the word in the row."""

from __future__ import annotations

from gateway.protocols.base.surface import handlers_of
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

HANDLERS = {"own_library": own.own_library} | handlers_of(
    accessories, clock, help, moon, motion, objects, search, site, target, tracking
)
