"""Positions, gotos, syncs as a hand control answers them.

A hand control always says ``#`` to a goto: a refusal shows as no motion (``L`` stays 0) and in the log. On an
equatorial hand control the azimuth and altitude commands read and move the motor axes.
"""

from __future__ import annotations

from gateway.astro.spherical import fold_declination, wrap180
from gateway.core.errors import Unsupported
from gateway.core.operations import AbortSlew, Goto, PierSide, Slewing, Sync, Values
from gateway.protocols.base.wants import FireAndForget, Handling
from gateway.protocols.nexstar.session import NexStarSession
from gateway.protocols.nexstar.surface.acknowledged import attempt, begin
from gateway.protocols.nexstar.surface.devices import motor
from gateway.protocols.nexstar.surface.frames import german, readings, to_mount
from gateway.protocols.wireformat.command import Command


def axes(session: NexStarSession, command: Command, values: Values) -> Handling:
    """Z z"""
    return (yield from readings(session))


def goto(session: NexStarSession, command: Command, values: Values) -> Handling:
    """R r - acknowledged at once; a malformed one does nothing."""
    if "fault" not in values:
        session.kept.axis_goto = {}
        yield from begin(Goto(*fold_declination(values["ra"], values["dec"])))


def goto_axes(session: NexStarSession, command: Command, values: Values) -> Handling:
    """B b"""
    if "fault" not in values:
        session.kept.axis_goto = {}
        yield from begin((yield from to_mount(session, values["az"], values["alt"])))


def sync(session: NexStarSession, command: Command, values: Values) -> Handling:
    """S s - what cannot be done shows in the log alone."""
    if "fault" not in values:
        yield from attempt(Sync(*fold_declination(values["ra"], values["dec"])))


def slewing(session: NexStarSession, command: Command, values: Values) -> Handling:
    """L - gotos only, ASCII."""
    return {"slewing": "1" if (yield Slewing()) else "0"}


def cancel(session: NexStarSession, command: Command, values: Values) -> Handling:
    """M - gotos only: motion at a rate goes on until rate 0."""
    yield FireAndForget(AbortSlew())


def pier_side(session: NexStarSession, command: Command, values: Values) -> Handling:
    """p - always E over a fork, and over a mount that has no way to tell it: a Meade never changes sides."""
    if not german(session):
        return {"side": "E"}
    try:
        return {"side": (yield PierSide())}
    except Unsupported:
        return {"side": "E"}


# --- single axes, for programs that speak to the motors ----------------------------------------------------------


def axis_position(session: NexStarSession, command: Command, values: Values) -> Handling:
    """AUX 0x01"""
    number = motor(values)
    seen = yield from readings(session)
    return {"position": seen.az if number == 1 else seen.alt}


def axis_goto(session: NexStarSession, command: Command, values: Values) -> Handling:
    """AUX 0x02, 0x17 - while the other axis is under way to where it was sent, it goes on; else it stays."""
    number = motor(values)
    seen = yield from readings(session)
    sent = session.kept.axis_goto if (yield Slewing()) else {}
    wanted = {1: seen.az, 2: seen.alt, **sent, number: values["position"]}
    yield from begin((yield from to_mount(session, wanted[1], wrap180(wanted[2]))))
    session.kept.axis_goto = {**sent, number: values["position"]}


def axis_done(session: NexStarSession, command: Command, values: Values) -> Handling:
    """AUX 0x13 - 255 when the goto is over."""
    motor(values)
    return {"done": 0 if (yield Slewing()) else 255}
