"""What a client searches for: limits of magnitude, size and quality, kinds of objects, the field's diameter."""

from __future__ import annotations

import re

from msgspec.structs import replace

from gateway.astro.catalog import QUALITIES
from gateway.core.errors import Invalid
from gateway.core.operations import Values
from gateway.protocols.base.wants import given
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

#: What :G and :S change.
_LIMITS = {"b": "brighter", "f": "fainter", "F": "field", "l": "larger", "s": "smaller", "y": "types", "q": "quality"}
_TYPES = re.compile("gpdco", re.IGNORECASE)


def tell_search(session: LxSession, command: Command, values: Values) -> object:
    """:Gb :Gf :GF :Gl :Gs :Gy :Gq"""
    return getattr(session.kept.search, _LIMITS[command.name[1]])


def set_search(session: LxSession, command: Command, values: Values) -> None:
    """:Sb :Sf :SF :Sl :Ss :Sy - the types are five letters in their order, capitals for what is wanted."""
    name = _LIMITS[command.name[1]]
    (value,) = given(values).values()
    if name == "types" and not _TYPES.fullmatch(value):
        raise Invalid("The types are GPDCO, capitals for those wanted.")
    session.kept.search = replace(session.kept.search, **{name: value})


def step_quality(session: LxSession, command: Command, values: Values) -> None:
    """:Sq - the next lower quality, from the worst back to the best."""
    present = QUALITIES.index(session.kept.search.quality)
    session.kept.search = replace(session.kept.search, quality=QUALITIES[(present + 1) % len(QUALITIES)])
