"""Targets, gotos and syncs.

Each client has its own target. Setting coordinates ends the selection of an object (``objects.py``), and refusing one
coordinate clears both. The Moon and the planets move: their positions are computed again for every goto, sync and
reply.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import Fault, NoTarget, Silence, Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling, ReuseLastReading
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.lx200.surface.clock import commit_draft_if_allowed
from gateway.protocols.wireformat.command import Command


def set_target(session: LxSession, values: op.Values) -> None:
    """:Sr :Sd - set one coordinate. Programs send :MS# even after a refusal (0), so a refusal clears the target."""
    session.client.deselect()
    _set_coordinates(session, values, "ra", "dec")


def set_horizontal_target(session: LxSession, values: op.Values) -> None:
    """:Sa :Sz - set one coordinate for :MA. Raises BelowHorizon or TooHigh beyond a limit, Invalid if it is garbled."""
    if "alt" in values:
        limits = session.limits
        try:
            limits.check_altitude(values["alt"])
        except Fault as fault:
            values = {"fault": fault}
    _set_coordinates(session, values, "alt", "az")


def _set_coordinates(session: LxSession, values: op.Values, *names: str) -> None:
    fault: Fault | None = None
    if "fault" in values:
        values, fault = dict.fromkeys(names), values["fault"]
    for name, value in values.items():
        setattr(session.client, name, value)
    if fault is not None:
        raise fault


def _current_target(session: LxSession) -> Handling:
    """Return where the target is now, as Equatorial. Raises NoTarget, with the reason if a selection has failed."""
    client = session.client
    if client.moving_object is not None:
        place: op.Equatorial = yield client.moving_object
        client.ra, client.dec = place.ra, place.dec
    if client.ra is None or client.dec is None:
        raise NoTarget(client.object_text)
    return op.Equatorial(client.ra, client.dec)


def tell_target(session: LxSession) -> Handling:
    """:Gr :Gd - a coordinate of the target: of a moving object the present one; 0 if none was set, as on a Meade."""
    if session.client.moving_object is not None:
        yield from _current_target(session)
    return {"ra": session.client.ra or 0.0, "dec": session.client.dec or 0.0}


def tell_second_coordinate(session: LxSession, command: Command) -> Handling:
    """:GD :GA - the second coordinate, of the same instant as a :GR or :GZ directly before."""
    before, asked = (b":GR#", op.Position()) if command.name == "GD" else (b":GZ#", op.HorizontalPosition())
    return (yield ReuseLastReading(asked) if session.last_frame == before else asked)


def goto(session: LxSession) -> Handling:
    """:MS - slew to the target. A clock that this client has set before is sent first."""
    client = session.client
    if client.clock_draft is not None:
        yield from commit_draft_if_allowed(session)
    place: op.Equatorial = yield from _current_target(session)
    limits = {"lowest": client.lowest, "highest": client.highest, "fastest": client.fastest}
    yield op.Goto(place.ra, place.dec, track=not client.land_mode, **limits)


def goto_horizontal(session: LxSession) -> Handling:
    """:MA - slew to the azimuth and altitude of :Sz and :Sa."""
    client = session.client
    if client.az is None or client.alt is None:
        raise NoTarget
    if client.clock_draft is not None:
        yield from commit_draft_if_allowed(session)
    yield op.GotoHorizontal(client.az, client.alt, lowest=client.lowest, highest=client.highest, fastest=client.fastest)


def sync(session: LxSession) -> Handling:
    """:CM - sync on the target. Programs read a bare # as a failure, and otherwise expect a text at once."""
    place: op.Equatorial = yield from _current_target(session)
    yield op.Sync(place.ra, place.dec)
    return {"text": session.client_settings.sync_text or session.model["sync_text"]}


def sync_on_moon(session: LxSession) -> Handling:
    """:CL - sync on the selected place on the Moon; the command has no reply."""
    if not isinstance(session.client.moving_object, op.MoonPlace):
        raise NoTarget
    place: op.Equatorial = yield from _current_target(session)
    yield FireAndForget(op.Sync(place.ra, place.dec))


def _native_idle_reply() -> Handling:
    """Return the telescope's own :D reply at rest; empty if it has none, or if its hand control moves it."""
    try:
        reply: bytes = yield op.NativeRequest("D", (), "fixed")
    except (Unsupported, Silence):
        return b""
    return b"" if reply.strip(b" #") else reply


def distance_bars(session: LxSession) -> Handling:
    """:D - a bar while a goto is under way, none when it has ended, in the form of the presented model."""
    slewing = yield op.Slewing()
    if not slewing and session.model.get("own"):
        idle = yield from _native_idle_reply()
        if idle:
            return idle
    return {"bars": session.model["bars_moving" if slewing else "bars_idle"]}
