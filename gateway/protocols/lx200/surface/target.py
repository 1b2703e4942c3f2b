"""Targets, gotos and syncs. A target is a client's own, until it is refused: a refused half clears the whole."""

from __future__ import annotations

from typing import Any

from gateway.core.errors import Fault, NoTarget, Silence, Unsupported
from gateway.core.operations import Equatorial, Goto, GotoHorizontal, HorizontalPosition, Own, Position, Slewing, Sync
from gateway.protocols.base.surface import Handling, ReuseLastReading, Session
from gateway.protocols.lx200.surface import selected
from gateway.protocols.wireformat.command import Command


def set_target(session: Session, _: Command, values: dict[str, Any]) -> None:
    """:Sr :Sd - programs go on to :MS# even after a 0, so a refused half must not leave a stale target."""
    selected.drop(session)
    _set(session, values, "ra", "dec")


def set_horizontal_target(session: Session, _: Command, values: dict[str, Any]) -> None:
    """:Sa :Sz - an altitude beyond the limits is out of the slew range. Raises BelowHorizon, TooHigh, Invalid."""
    if "alt" in values:
        limits = session.settings["limits"].narrowed(session.kept.get("lowest"), session.kept.get("highest"))
        try:
            limits.check_altitude(values["alt"])
        except Fault as fault:
            values = {"fault": fault}
    _set(session, values, "alt", "az")


def _set(session: Session, values: dict[str, Any], *pair: str) -> None:
    if "fault" in values:
        for name in pair:
            session.kept.pop(name, None)
        raise values["fault"]
    session.kept.update(values)


def tell_target(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:Gr :Gd - zero before any was set, as a Meade says after power-on; what moves, where it is now."""
    if "moving" in session.kept:
        yield from selected.target(session)
    return {name: session.kept.get(name, 0.0) for name in ("ra", "dec")}


def right_ascension(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:GR"""
    return (yield Position())


def declination(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:GD - of the same instant as the :GR before it."""
    return (yield ReuseLastReading(Position()) if session.last == b":GR#" else Position())


def azimuth(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:GZ"""
    return (yield HorizontalPosition())


def altitude(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:GA - of the same instant as the :GZ before it."""
    return (yield ReuseLastReading(HorizontalPosition()) if session.last == b":GZ#" else HorizontalPosition())


def goto(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:MS - to the target, or a refusal with words."""
    kept = session.kept
    place: Equatorial = yield from selected.target(session)
    yield Goto(
        place.ra,
        place.dec,
        lowest=kept.get("lowest"),
        highest=kept.get("highest"),
        track=not kept.get("land", False),
        fastest=kept.get("fastest"),
    )


def goto_horizontal(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:MA - to the azimuth and altitude of :Sz and :Sa."""
    kept = session.kept
    if "az" not in kept or "alt" not in kept:
        raise NoTarget
    yield GotoHorizontal(
        kept["az"], kept["alt"], lowest=kept.get("lowest"), highest=kept.get("highest"), fastest=kept.get("fastest")
    )


def sync(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:CM - a bare # is what programs read as failure; they want a text at once otherwise."""
    place: Equatorial = yield from selected.target(session)
    yield Sync(place.ra, place.dec)
    return {"text": session.settings.get("sync_text") or session.model["sync_text"]}


def _own_idle() -> Handling:
    """What this telescope sends while it stands; empty where it does not say, or moves at somebody's keys."""
    try:
        said: bytes = yield Own("D", (), "fixed")
    except (Unsupported, Silence):
        return b""
    return b"" if said.strip(b" #") else said


def distance_bars(session: Session, _: Command, values: dict[str, Any]) -> Handling:
    """:D - one bar while a goto is under way, nothing when it is over."""
    slewing = yield Slewing()
    if not slewing and session.model.get("own"):
        idle = yield from _own_idle()
        if idle:
            return idle
    return {"bars": session.model["bars_moving" if slewing else "bars_idle"]}
