"""The object a client has selected: its name for :LI, its place as the target, and whether that place moves.

The Moon and the planets move: they are worked out anew for every goto, sync and reply. Whatever the client sets by
coordinates ends the selection, and a selection that fails leaves no target, so that no goto follows to the last one.
"""

from __future__ import annotations

from gateway.astro.catalog import Entry, describe
from gateway.core.errors import Fault, NoTarget
from gateway.core.operations import Equatorial, MoonPlace, PlanetPlace, ToEquinoxOfDate
from gateway.protocols.base.wants import Handling
from gateway.protocols.lx200.session import LxSession


def drop(session: LxSession) -> None:
    """The target is no object any more."""
    session.kept.entry = session.kept.moving = session.kept.object = None


def fail(session: LxSession, words: str) -> None:
    """Nothing is selected, and these words say why, to :LI and to the next :MS."""
    drop(session)
    session.kept.ra = session.kept.dec = None
    session.kept.object = words


def select(session: LxSession, entry: Entry) -> Handling:
    """A catalogue's object becomes the target."""
    place: Equatorial = yield ToEquinoxOfDate(entry.ra, entry.dec)
    drop(session)
    kept = session.kept
    kept.ra, kept.dec, kept.entry, kept.object = place.ra, place.dec, entry, describe(entry)


def follow(session: LxSession, moving: MoonPlace | PlanetPlace, words: str) -> Handling:
    """Something that moves becomes the target. Raises Fault while it has no place: then nothing is selected."""
    try:
        place: Equatorial = yield moving
    except Fault as fault:
        fail(session, str(fault))
        raise
    drop(session)
    kept = session.kept
    kept.ra, kept.dec, kept.moving, kept.object = place.ra, place.dec, moving, words


def target(session: LxSession) -> Handling:
    """-> Equatorial: where the target is now. Raises what its place raises, and NoTarget, with words where something
    was selected in vain.
    """
    kept = session.kept
    if kept.moving is not None:
        place: Equatorial = yield kept.moving
        kept.ra, kept.dec = place.ra, place.dec
    if kept.ra is None or kept.dec is None:
        raise NoTarget(kept.object)
    return Equatorial(kept.ra, kept.dec)
