"""Sites, their names, and altitude limits. Longitudes are west positive on the wire and east positive in the gateway.

Site 1 is the mount's own. The gateway stores it when a client selects another site. When the client returns to site 1,
the mount gets it back only if the mount was given the other site: a site entered on its hand control meanwhile is kept.
"""

from __future__ import annotations

from contextlib import suppress

from msgspec.structs import replace

from gateway.core.errors import Fault, Invalid
from gateway.core.operations import GetSite, Place, SetSite, Values
from gateway.protocols.base.session import NamedSite
from gateway.protocols.base.wants import Handling, decoded
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

_SITE_LETTERS = "MNOP"  # of the four sites, in the commands for their names
_MAX_SITE_NUMBER = 4  # the highest number that :W does not ignore


def tell_site_coordinate(session: LxSession, command: Command) -> Handling:
    """:Gt :Gg - the mount's latitude or longitude, else that of the selected site. Raises Fault if neither is known."""
    name = "latitude" if command.name == "Gt" else "longitude"
    try:
        site: Place | NamedSite = yield GetSite()
    except Fault:
        site = session.shared.site_at(_selected_site(session))
        if getattr(site, name) is None:
            raise
    return {name: getattr(site, name) if name == "latitude" else -getattr(site, name)}


def _selected_site(session: LxSession) -> int:
    """Return the site number of this client, from 0: its own selection, else the last selection of any client."""
    return (session.shared.site or 0) if session.client.site_index is None else session.client.site_index


def set_site_coordinate(session: LxSession, values: Values) -> Handling:
    """:St :Sg - store latitude or longitude in the selected site and set it on the mount."""
    [(name, value)] = decoded(values).items()
    coordinate = {name: value if name == "latitude" else -value}
    session.check_write_access()
    index = _selected_site(session)
    yield from _select_for_all(session, index)
    session.replace_shared(session.shared.with_site(index, replace(session.shared.site_at(index), **coordinate)))
    yield replace(SetSite(), **coordinate)


def _select_for_all(session: LxSession, site_index: int) -> Handling:
    """Select this site for all clients that have selected none; on leaving site 1, store the mount's own site there."""
    if not session.shared.site and site_index != 0:
        with suppress(Fault):
            place: Place = yield GetSite()
            first = replace(session.shared.site_at(0), latitude=place.latitude, longitude=place.longitude)
            session.replace_shared(session.shared.with_site(0, first))
    if session.shared.site != site_index:
        session.replace_shared(replace(session.shared, site=site_index))


def select_site(session: LxSession, values: Values) -> Handling:
    """:W - select a site; the model counts from 0 or 1. A number up to 4 that it lacks means the nearest that it has; a
    greater number is ignored. A stored site is then set on the mount.
    """
    number = decoded(values)["site"]
    if number > _MAX_SITE_NUMBER:
        return
    session.check_write_access()
    index = max(0, min(len(_SITE_LETTERS) - 1, number - session.model["first_site"]))
    before = session.shared.site or 0
    yield from _select_for_all(session, index)
    session.client.site_index = index
    stored = _stored_site(session, index)
    if index == 0:
        if before != 0:
            others = tuple(_stored_site(session, other) for other in range(1, len(_SITE_LETTERS)))
            yield SetSite(stored.latitude, stored.longitude, others)
    elif stored.latitude is not None and stored.longitude is not None:
        yield stored


def _stored_site(session: LxSession, site_index: int) -> SetSite:
    """Return the stored site; a coordinate that is not stored is None."""
    stored = session.shared.site_at(site_index)
    return SetSite(stored.latitude, stored.longitude)


def tell_name(session: LxSession, command: Command) -> dict[str, str]:
    """:GM :GN :GO :GP - the name of a site; without a name SITE 1 (classic: ST1) and so on."""
    index, longest = _SITE_LETTERS.index(command.name[1]), session.model["names"]
    unnamed = f"SITE {index + 1}" if longest > len("ST1") else f"ST{index + 1}"
    return {"name": (session.shared.site_at(index).name or unnamed)[:longest]}


def set_name(session: LxSession, command: Command, values: Values) -> None:
    """:SM :SN :SO :SP - set a site's name. Raises Invalid unless it has 1 to 15 (classic: 3) printable characters."""
    name = values.get("name", "").strip()
    if not name or len(name) > session.model["names"] or not (name.isascii() and name.isprintable()):
        raise Invalid(f"A site name has 1 to {session.model['names']} printable characters.")
    index = _SITE_LETTERS.index(command.name[1])
    session.replace_shared(session.shared.with_site(index, replace(session.shared.site_at(index), name=name)))


def set_limit(session: LxSession, command: Command, values: Values) -> None:
    """:So :Sh - the lowest and the highest altitude, as real programs use them (the manual describes them differently).
    Raises Invalid for limits that leave no altitude, because nothing could be moved any more.
    """
    name = "lowest" if command.name == "So" else "highest"
    wanted = {"lowest": session.client.lowest, "highest": session.client.highest, name: float(decoded(values)["limit"])}
    limits = session.client_settings.limits.narrowed(**wanted)
    if limits.lowest >= limits.highest:
        raise Invalid(f"Nothing is left between {limits.lowest:g} and {limits.highest:g} degrees.")
    setattr(session.client, name, wanted[name])


def tell_limit(session: LxSession, command: Command) -> dict[str, float]:
    """:Go :Gh - the lowest and the highest altitude in force for this client."""
    limits = session.limits
    return {"limit": limits.lowest if command.name == "Go" else limits.highest}
