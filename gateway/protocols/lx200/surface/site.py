"""Sites, their names, and altitude limits. Meade's longitudes count west positive; inside they count east."""

from __future__ import annotations

from typing import Any

from gateway.errors import Invalid
from gateway.operations import GetSite, Place, SetSite
from gateway.surface import Handling, Session
from gateway.tables import Command

_SITES = "MNOP"


def tell_latitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Gt"""
    place: Place = yield GetSite()
    return {"latitude": place.latitude}


def tell_longitude(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:Gg"""
    place: Place = yield GetSite()
    return {"longitude": -place.longitude}


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


def _set(session: Session, operation: SetSite) -> Handling:
    """Set one half, and remember it under the site that is selected."""
    stored = session.shared["sites"].setdefault(str(session.kept.get("site", session.shared.get("site", 0))), {})
    for name in ("latitude", "longitude"):
        value = getattr(operation, name)
        if value is not None:
            stored[name] = value
    session.changed()
    yield operation


def select(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """:W - by this model's count: from 0, or from 1 with 0 for the first."""
    if "fault" in values:
        raise values["fault"]
    index = values["site"]
    index = max(0, index - 1) if session.model["first_site"] == 1 else index
    if index > 3:
        return
    session.kept["site"] = index
    session.set_for_all("site", index)  # where a program that selects none begins, as at power-on
    stored = session.shared["sites"].get(str(index), {})
    if "latitude" in stored and "longitude" in stored:
        yield SetSite(latitude=stored["latitude"], longitude=stored["longitude"])


def tell_name(session: Session, command: Command, values: dict[str, Any]) -> dict[str, str]:
    """:GM :GN :GO :GP"""
    index = _SITES.index(command.name[1])
    stored = session.shared["sites"].get(str(index), {})
    return {"name": stored.get("name", f"SITE {index + 1}")[: session.model["names"]]}


def set_name(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:SM :SN :SO :SP - 3 letters on the classic, 15 elsewhere."""
    name = values.get("name", "").strip()
    if not name or len(name) > session.model["names"] or not (name.isascii() and name.isprintable()):
        raise Invalid(f"A site name has 1 to {session.model['names']} printable characters.")
    session.shared["sites"].setdefault(str(_SITES.index(command.name[1])), {})["name"] = name
    session.changed()


def set_lowest(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:So - as real programs use it (against the manual's words): the lowest altitude; over 90 it is in arcminutes."""
    session.kept["lowest"] = _degrees(values)


def set_highest(session: Session, command: Command, values: dict[str, Any]) -> None:
    """:Sh - the highest altitude."""
    session.kept["highest"] = _degrees(values)


def _degrees(values: dict[str, Any]) -> float:
    if "fault" in values:
        raise values["fault"]
    return float(values["limit"])


def tell_limit(session: Session, command: Command, values: dict[str, Any]) -> dict[str, float]:
    """:Go the lowest, :Gh the highest altitude in force for this client."""
    limits = session.settings["limits"].narrowed(session.kept.get("lowest"), session.kept.get("highest"))
    return {"limit": limits.lowest if command.name == "Go" else limits.highest}
