"""Targets, gotos and syncs.

A target is a client's own. What the client sets by coordinates ends its selection of an object (``objects.py``), and a
half that is refused clears the whole. The Moon and the planets move: they are worked out anew for every goto, sync and
reply.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import Fault, NoTarget, Silence, Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling, ReuseLastReading
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command


def set_target(session: LxSession, _: Command, values: op.Values) -> None:
    """:Sr :Sd - programs go on to :MS# even after a 0, so a refused half must not leave a stale target."""
    session.kept.deselect()
    _set(session, values, "ra", "dec")


def set_horizontal_target(session: LxSession, _: Command, values: op.Values) -> None:
    """:Sa :Sz - an altitude beyond the limits is out of the slew range. Raises BelowHorizon, TooHigh, Invalid."""
    if "alt" in values:
        limits = session.limits
        try:
            limits.check_altitude(values["alt"])
        except Fault as fault:
            values = {"fault": fault}
    _set(session, values, "alt", "az")


def _set(session: LxSession, values: op.Values, *pair: str) -> None:
    fault: Fault | None = None
    if "fault" in values:
        values, fault = dict.fromkeys(pair), values["fault"]
    for name, value in values.items():
        setattr(session.kept, name, value)
    if fault is not None:
        raise fault


def _target(session: LxSession) -> Handling:
    """-> Equatorial: where the target is now. Raises what its place raises, and NoTarget, with words where something
    was selected in vain.
    """
    kept = session.kept
    if kept.moving is not None:
        place: op.Equatorial = yield kept.moving
        kept.ra, kept.dec = place.ra, place.dec
    if kept.ra is None or kept.dec is None:
        raise NoTarget(kept.object)
    return op.Equatorial(kept.ra, kept.dec)


def tell_target(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:Gr :Gd - zero before any was set, as a Meade says after power-on; what moves, where it is now."""
    if session.kept.moving is not None:
        yield from _target(session)
    return {"ra": session.kept.ra or 0.0, "dec": session.kept.dec or 0.0}


def second_half(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:GD :GA - of the same instant as the :GR or :GZ before it."""
    before, asked = (b":GR#", op.Position()) if command.name == "GD" else (b":GZ#", op.HorizontalPosition())
    return (yield ReuseLastReading(asked) if session.last == before else asked)


def goto(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:MS - to the target, or a refusal with words."""
    kept = session.kept
    place: op.Equatorial = yield from _target(session)
    limits = {"lowest": kept.lowest, "highest": kept.highest, "fastest": kept.fastest}
    yield op.Goto(place.ra, place.dec, track=not kept.land, **limits)


def goto_horizontal(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:MA - to the azimuth and altitude of :Sz and :Sa."""
    kept = session.kept
    if kept.az is None or kept.alt is None:
        raise NoTarget
    yield op.GotoHorizontal(kept.az, kept.alt, lowest=kept.lowest, highest=kept.highest, fastest=kept.fastest)


def sync(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:CM - a bare # is what programs read as failure; they want a text at once otherwise."""
    place: op.Equatorial = yield from _target(session)
    yield op.Sync(place.ra, place.dec)
    return {"text": session.settings.sync_text or session.model["sync_text"]}


def sync_on_moon(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:CL - only to a place on the Moon; the command has no reply."""
    if not isinstance(session.kept.moving, op.MoonPlace):
        raise NoTarget
    place: op.Equatorial = yield from _target(session)
    yield FireAndForget(op.Sync(place.ra, place.dec))


def _own_idle() -> Handling:
    """What this telescope sends while it stands; empty where it does not say, or moves at somebody's keys."""
    try:
        said: bytes = yield op.Own("D", (), "fixed")
    except (Unsupported, Silence):
        return b""
    return b"" if said.strip(b" #") else said


def distance_bars(session: LxSession, _: Command, values: op.Values) -> Handling:
    """:D - one bar while a goto is under way, nothing when it is over."""
    slewing = yield op.Slewing()
    if not slewing and session.model.get("own"):
        idle = yield from _own_idle()
        if idle:
            return idle
    return {"bars": session.model["bars_moving" if slewing else "bars_idle"]}
