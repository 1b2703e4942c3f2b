"""The functions that rows of ``mappings/nexstar/surface.toml`` call, by the word in the row."""

from __future__ import annotations

from gateway.protocols.base.surface import Special, handlers_of
from gateway.protocols.nexstar.surface import devices, identity, motion, place, pointing

#: row word -> function; the same word may stand in several modules, so it is written ``module.function``.
HANDLERS: dict[str, Special] = {
    f"{module.__name__.rpartition('.')[2]}.{name}": function
    for module in (devices, identity, motion, place, pointing)
    for name, function in handlers_of(module).items()
}
