"""Sites, their names, and altitude limits. Meade's longitudes count west positive; inside they count east.

Site 1 is the mount's own. What it is gets remembered when another one takes its place, and is put back on the mount
only where the mount was told the other one; what was entered at the hand control meanwhile stays.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from gateway.core.errors import Fault, Invalid
from gateway.core.operations import GetSite, Place, SetSite
from gateway.protocols.base.surface import Handling, Session
from gateway.protocols.wireformat.command import Command

#: The letters of the four sites in the commands of their names, and the highest number that ``:W`` takes.
_NAMED = "MNOP"
_SITES_AT_MOST = 4


def tell_latitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Gt"""
    return {"latitude": (yield from _told(session, "latitude"))}


def tell_longitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Gg"""
    return {"longitude": -(yield from _told(session, "longitude"))}


def _told(session: Session, half: str) -> Handling:
    """-> half of the site in force; where nobody knows the other half, the one that was set. Raises Fault."""
    try:
        place: Place = yield GetSite()
    except Fault:
        stored = session.shared["sites"].get(str(_selected(session)), {})
        if half not in stored:
            raise
        return stored[half]
    return getattr(place, half)


def set_latitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:St"""
    if "fault" in values:
        raise values["fault"]
    yield from _set(session, SetSite(latitude=values["latitude"]))


def set_longitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Sg"""
    if "fault" in values:
        raise values["fault"]
    yield from _set(session, SetSite(longitude=-values["longitude"]))


def _selected(session: Session) -> int:
    """The site that this client sets: the one it selected, else the one selected last, from 0."""
    index: int = session.kept.get("site", session.shared.get("site", 0))
    return index


def _set(session: Session, operation: SetSite) -> Handling:
    """Set one half, and remember it under the site that is selected."""
    session.check_may_set()
    index = _selected(session)
    yield from _enter(session, index)
    stored = session.shared["sites"].setdefault(str(index), {})
    for name in ("latitude", "longitude"):
        value = getattr(operation, name)
        if value is not None:
            stored[name] = value
    session.changed()
    yield operation


def _enter(session: Session, index: int) -> Handling:
    """This site is in force for all from now on, and for who selects none, as at power-on; what site 1 is, is kept."""
    if session.shared.get("site", 0) == 0 and index != 0:
        with suppress(Fault):
            place: Place = yield GetSite()
            own = session.shared["sites"].setdefault("0", {})
            own.update(latitude=place.latitude, longitude=place.longitude)
    if session.shared.get("site") != index:
        session.set_for_all("site", index)


def select(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:W - by this model's count, from 0 or from 1; the number that the count does not have is the nearest site."""
    if "fault" in values:
        raise values["fault"]
    if values["site"] > _SITES_AT_MOST:
        return
    session.check_may_set()
    index = max(0, min(len(_NAMED) - 1, values["site"] - session.model["first_site"]))
    before = session.shared.get("site", 0)
    yield from _enter(session, index)
    session.kept["site"] = index
    stored = _place(session, index)
    if index == 0:
        if before != 0:
            others = tuple(_place(session, number) for number in range(1, len(_NAMED)))
            yield SetSite(stored.latitude, stored.longitude, others)
    elif stored.latitude is not None and stored.longitude is not None:
        yield stored


def _place(session: Session, index: int) -> SetSite:
    """What is stored of a site; None for what is not."""
    stored = session.shared["sites"].get(str(index), {})
    return SetSite(stored.get("latitude"), stored.get("longitude"))


def tell_name(session: Session, command: Command, values: dict[str, Any]) -> dict[str, str]:
    """:GM :GN :GO :GP - four names that can be told apart, also before anybody has named a site."""
    index, longest = _NAMED.index(command.name[1]), session.model["names"]
    unnamed = f"SITE {index + 1}" if longest > len("ST1") else f"ST{index + 1}"
    stored = session.shared["sites"].get(str(index), {})
    return {"name": stored.get("name", unnamed)[:longest]}


def set_name(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:SM :SN :SO :SP - 3 letters on the classic, 15 elsewhere."""
    name = values.get("name", "").strip()
    if not name or len(name) > session.model["names"] or not (name.isascii() and name.isprintable()):
        raise Invalid(f"A site name has 1 to {session.model['names']} printable characters.")
    session.shared["sites"].setdefault(str(_NAMED.index(command.name[1])), {})["name"] = name
    session.changed()


def set_lowest(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:So - as real programs use it (against the manual's words): the lowest altitude; over 90 it is in arcminutes."""
    _narrow(session, "lowest", _degrees(values))


def set_highest(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:Sh - the highest altitude."""
    _narrow(session, "highest", _degrees(values))


def _narrow(session: Session, which: str, altitude: float) -> None:
    """Raises Invalid for a limit that leaves no altitude at all: nothing could be moved any more."""
    wanted = {name: session.kept.get(name) for name in ("lowest", "highest")} | {which: altitude}
    limits = session.settings["limits"].narrowed(wanted["lowest"], wanted["highest"])
    if limits.lowest >= limits.highest:
        raise Invalid(f"Nothing is left between {limits.lowest:g} and {limits.highest:g} degrees.")
    session.kept[which] = altitude


def _degrees(values: dict[str, Any]) -> float:
    if "fault" in values:
        raise values["fault"]
    return float(values["limit"])


def tell_limit(session: Session, command: Command, values: dict[str, Any]) -> dict[str, float]:
    """:Go the lowest, :Gh the highest altitude in force for this client."""
    limits = session.settings["limits"].narrowed(session.kept.get("lowest"), session.kept.get("highest"))
    return {"limit": limits.lowest if command.name == "Go" else limits.highest}
