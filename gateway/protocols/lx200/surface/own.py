"""A surface that presents the Meade itself: its own library, and where its own answer would contradict the gateway's.

What a client has chosen in the telescope's library becomes this client's target, with the words that the telescope has
for it; so two programs that look things up do not go to each other's objects.
"""

from __future__ import annotations

from gateway.core.errors import Fault
from gateway.core.operations import Choose, Chosen, Own, PassThrough, Values
from gateway.protocols.base.wants import Handling
from gateway.protocols.lx200.session import Draft, LxSession
from gateway.protocols.wireformat.command import Command

#: Which catalogue a number is of: chosen by another command, which is said again before, for others choose as well.
_CATALOGUE = {"LC": "Lo", "LS": "Ls", "LF": "Lo", "LN": "Lo", "LB": "Lo"}
_CATALOGUES = ("Lo", "Ls")


def stands_against(session: LxSession, name: str, values: Values) -> bool:
    """Whether this client was told something that the mount's own answer would contradict."""
    kept = session.kept
    return name == "GG" and (kept.offset is not None or kept.draft not in (None, Draft()))


def own_library(session: LxSession, command: Command, values: Values) -> Handling:
    """:Lo :Ls :LC :LM :LS :LF :LN :LB :LI of the telescope itself."""
    kept = session.kept
    if command.name == "LI":
        return (yield Own("LI", (), "moment")) if kept.object is None else f"{kept.object}#".encode("latin-1")
    if command.name in _CATALOGUES:
        others = {name: fields for name, fields in kept.own_catalogs.items() if name != command.name}
        try:
            answer = yield PassThrough(command.name, tuple(values.items()))
        except Fault:
            kept.own_catalogs = others
            raise
        kept.own_catalogs = {**others, command.name: tuple(values.items())}
        return answer
    catalogue = _CATALOGUE.get(command.name, "")
    chosen_by = kept.own_catalogs.get(catalogue)
    first = () if chosen_by is None else ((catalogue, chosen_by),)
    chosen: Chosen = yield Choose(command.name, tuple(values.items()), first, kept.ra or 0.0, kept.dec or 0.0)
    if chosen.place is not None:
        kept.deselect()
        kept.ra, kept.dec, kept.object = chosen.place.ra, chosen.place.dec, chosen.text
    return chosen.reply
