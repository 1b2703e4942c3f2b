"""What a client searches for: limits of magnitude, size and quality, kinds of objects, the field's diameter."""

from __future__ import annotations

import re
from typing import Any

from gateway.astro.catalog import QUALITIES
from gateway.core.errors import Invalid
from gateway.protocols.base.surface import Session
from gateway.protocols.wireformat.command import Command

#: What :G and :S change, under which name it is kept, and what holds until it is set: everything.
LIMITS = {"b": ("brighter", -5.5), "f": ("fainter", 20.0), "F": ("field", 15), "l": ("larger", 0),
          "s": ("smaller", 200), "y": ("types", "GPDCO"), "q": ("quality", "VP")}  # fmt: skip
_TYPES = re.compile("gpdco", re.IGNORECASE)


def tell_search(session: Session, command: Command, values: dict[str, Any]) -> Any:
    """:Gb :Gf :GF :Gl :Gs :Gy :Gq"""
    name, default = LIMITS[command.name[1]]
    return session.kept.get(name, default)


def set_search(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:Sb :Sf :SF :Sl :Ss :Sy - the types are five letters in their order, capitals for what is wanted."""
    if "fault" in values:
        raise values["fault"]
    name, _ = LIMITS[command.name[1]]
    (value,) = values.values()
    if name == "types" and not _TYPES.fullmatch(value):
        raise Invalid("The types are GPDCO, capitals for those wanted.")
    session.kept[name] = value


def step_quality(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:Sq - the next lower quality, from the worst back to the best."""
    present = QUALITIES.index(session.kept.get("quality", "VP"))
    session.kept["quality"] = QUALITIES[(present + 1) % len(QUALITIES)]
