"""A surface that presents the Meade itself: its own library, and where its own answer would contradict the gateway's.

What a client has chosen in the telescope's library becomes this client's target, with the words that the telescope has
for it; so two programs that look things up do not go to each other's objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gateway.core.errors import Fault
from gateway.core.operations import Choose, Chosen, Own, Verbatim
from gateway.protocols.base.surface import Handling, Session
from gateway.protocols.lx200.surface import selected
from gateway.protocols.wireformat.command import Command

#: Which catalogue a number is of: chosen by another command, which is said again before, for others choose as well.
_CATALOGUE = {"LC": "Lo", "LS": "Ls", "LF": "Lo", "LN": "Lo", "LB": "Lo"}
_CATALOGUES = ("Lo", "Ls")


def stands_against(session: Session, name: str, values: Mapping[str, Any]) -> bool:
    """Whether this client was told something that the mount's own answer would contradict."""
    if name == "GG":
        return bool("offset" in session.kept or session.kept.get("draft"))
    return name == "GT" and "hertz" in session.shared


def own_library(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Lo :Ls :LC :LM :LS :LF :LN :LB :LI of the telescope itself."""
    kept = session.kept
    if command.name == "LI":
        return f"{kept['object']}#".encode("latin-1") if "object" in kept else (yield Own("LI", (), "moment"))
    if command.name in _CATALOGUES:
        try:
            answer = yield Verbatim(command.name, tuple(values.items()))
        except Fault:
            kept.pop(command.name, None)
            raise
        kept[command.name] = tuple(values.items())
        return answer
    catalogue = _CATALOGUE.get(command.name, "")
    first = ((catalogue, kept[catalogue]),) if catalogue in kept else ()
    chosen: Chosen = yield Choose(command.name, tuple(values.items()), first, kept.get("ra", 0.0), kept.get("dec", 0.0))
    if chosen.place is not None:
        selected.drop(session)
        kept.update(ra=chosen.place.ra, dec=chosen.place.dec, object=chosen.text)
    return chosen.reply
