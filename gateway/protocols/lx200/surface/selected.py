"""The object a client has selected: its name for :LI, its place as the target, and whether that place moves.

The Moon and the planets move: they are worked out anew for every goto, sync and reply. Whatever the client sets by
coordinates ends the selection, and a selection that fails leaves no target, so that no goto follows to the last one.
"""

from __future__ import annotations

from typing import Any

from gateway.astro.catalog import Entry, describe
from gateway.core.errors import Fault, NoTarget
from gateway.core.operations import Equatorial, OfDate, Read
from gateway.protocols.base.surface import Handling, Session

_TARGET = ("ra", "dec")
_OBJECT = ("entry", "moving", "object")


def drop(session: Session) -> None:
    """The target is no object any more."""
    for name in _OBJECT:
        session.kept.pop(name, None)


def fail(session: Session, words: str) -> None:
    """Nothing is selected, and these words say why, to :LI and to the next :MS."""
    drop(session)
    for name in _TARGET:
        session.kept.pop(name, None)
    session.kept["object"] = words


def select(session: Session, entry: Entry) -> Handling:
    """A catalogue's object becomes the target."""
    place: Equatorial = yield OfDate(entry.ra, entry.dec)
    drop(session)
    session.kept.update(ra=place.ra, dec=place.dec, entry=entry, object=describe(entry))


def follow(session: Session, moving: Read, words: str) -> Handling:
    """Something that moves becomes the target. Raises Fault while it has no place: then nothing is selected."""
    try:
        place: Equatorial = yield moving
    except Fault as fault:
        fail(session, str(fault))
        raise
    drop(session)
    session.kept.update(ra=place.ra, dec=place.dec, moving=moving, object=words)


def target(session: Session) -> Handling:
    """-> Equatorial: where the target is now. Raises NoTarget, and what its place raises."""
    kept: dict[str, Any] = session.kept
    if "moving" in kept:
        place: Equatorial = yield kept["moving"]
        kept.update(ra=place.ra, dec=place.dec)
    if "ra" not in kept or "dec" not in kept:
        raise NoTarget(kept.get("object"))
    return Equatorial(kept["ra"], kept["dec"])
