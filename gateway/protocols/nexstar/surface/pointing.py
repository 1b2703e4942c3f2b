"""Positions, gotos and syncs as a hand control answers them.

A hand control always replies ``#`` to a goto: a refusal shows only as no motion (``L`` stays 0) and in the log. On an
equatorial mount the azimuth and altitude commands read and move the motor axes, in the coordinates of the presented
model: on an alt-az fork azimuth and altitude, on a German mount the hour angle. On a wedge, the first axis of a fork
reads 180 on the meridian in the northern hemisphere and 0 in the southern; it never turns over the pole. If the user
presents a German mount as a fork, the commands mean azimuth and altitude of the sky, as rotators need it.
"""

from __future__ import annotations

from contextlib import suppress

from gateway.astro.spherical import fold_declination, wrap180, wrap360
from gateway.core import operations as op
from gateway.core.errors import Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling
from gateway.protocols.nexstar.session import NexStarSession, attempt, begin
from gateway.protocols.nexstar.surface.devices import addressed_axis

#: What the first axis of a Celestron German mount reads at the pole, degrees.
POLE_READING = 90.0


def axes(session: NexStarSession) -> Handling:
    """Z z - the readings of both axes."""
    return (yield from _axis_readings(session))


def goto(session: NexStarSession, values: op.Values) -> Handling:
    """R r - slew; acknowledged at once. A malformed command is acknowledged and ignored."""
    if "fault" not in values:
        session.client.axis_goals = {}
        yield from begin(op.Goto(*fold_declination(values["ra"], values["dec"])))


def goto_axes(session: NexStarSession, values: op.Values) -> Handling:
    """B b - slew to axis readings. A malformed command is acknowledged and ignored."""
    if "fault" not in values:
        session.client.axis_goals = {}
        yield from begin((yield from _goto_operation(session, values["az"], values["alt"])))


def sync(values: op.Values) -> Handling:
    """S s - sync; a refusal shows only in the log."""
    if "fault" not in values:
        yield from attempt(op.Sync(*fold_declination(values["ra"], values["dec"])))


def slewing() -> Handling:
    """L - whether a goto is under way, as ASCII; hand motion does not count."""
    return {"slewing": "1" if (yield op.Slewing()) else "0"}


def cancel() -> Handling:
    """M - end gotos only: motion at a rate continues until rate 0."""
    yield FireAndForget(op.AbortSlew())


def pier_side(session: NexStarSession) -> Handling:
    """p - the pier side; E if the presented model is a fork, or the mount reports no pier side."""
    with suppress(Unsupported):
        if _presents_german_mount(session):
            return {"side": (yield op.PierSide())}
    return {"side": "E"}


# --- single axes, for programs that speak to the motors ----------------------------------------------------------


def axis_position(session: NexStarSession, values: op.Values) -> Handling:
    """AUX 0x01 - the reading of an axis, degrees."""
    axis = addressed_axis(values)
    readings = yield from _axis_readings(session)
    return {"position": readings.az if axis == 1 else readings.alt}


def axis_goto(session: NexStarSession, values: op.Values) -> Handling:
    """AUX 0x02, 0x17 - goto of an axis. The other axis continues its own goto, or stays."""
    axis = addressed_axis(values)
    readings = yield from _axis_readings(session)
    goals = session.client.axis_goals if (yield op.Slewing()) else {}
    wanted = {1: readings.az, 2: readings.alt, **goals, axis: values["position"]}
    yield from begin((yield from _goto_operation(session, wanted[1], wrap180(wanted[2]))))
    session.client.axis_goals = {**goals, axis: values["position"]}


def axis_done(values: op.Values) -> Handling:
    """AUX 0x13 - 255 when the goto has ended, else 0."""
    addressed_axis(values)
    return {"done": 0 if (yield op.Slewing()) else 255}


# --- the axes of the presented hand control --------------------------------------------------------------------------


def _presents_german_mount(session: NexStarSession) -> bool:
    """Whether the presented model is a German mount."""
    return bool(session.model["mount"] == "german")


def _axis_offset(session: NexStarSession) -> float:
    """Return how many degrees more a Celestron's first axis reads than that of the presented mount; 0 for a fork."""
    return POLE_READING - float(session.model.get("index", POLE_READING)) if _presents_german_mount(session) else 0.0


def _axis_readings(session: NexStarSession) -> Handling:
    """Return the axis readings of the presented model as Horizontal."""
    position: op.Horizontal = yield from _native_readings(session)
    ahead = _axis_offset(session)
    return op.Horizontal(wrap360(position.az - ahead), position.alt) if ahead else position


def _native_readings(session: NexStarSession) -> Handling:
    """Return the axis readings of the presented model, counted as a Celestron counts them."""
    status: op.Status = yield op.GetStatus()
    if not _wedge_as_german(session, status):
        return (yield op.AxisPosition() if _uses_axes(session, status) else op.HorizontalPosition())
    position: op.Horizontal = yield op.AxisPosition()
    return op.Horizontal(wrap360(position.az - (yield from _meridian_reading())), position.alt)


def _goto_operation(session: NexStarSession, first: float, second: float) -> Handling:
    """Return the operation that turns both axes to these readings of the presented model."""
    status: op.Status = yield op.GetStatus()
    first += _axis_offset(session)
    if not _wedge_as_german(session, status):
        return op.GotoAxes(first, second) if _uses_axes(session, status) else op.GotoHorizontal(first % 360.0, second)
    second = wrap180(second)
    if abs(second) > 90.0:  # a German mount on the other side of its pier; a fork does not turn over the pole
        first, second = first + 180.0, wrap180(180.0 - second)
    return op.GotoAxes(wrap360(first + (yield from _meridian_reading())), second)


def _uses_axes(session: NexStarSession, status: op.Status) -> bool:
    """Whether the azimuth and altitude commands read and move motor axes. If not, they mean azimuth and altitude."""
    return status.equatorial if session.model.get("own") else _presents_german_mount(session) or status.wedge


def _wedge_as_german(session: NexStarSession, status: op.Status) -> bool:
    """Whether a fork on its wedge is presented as a German mount."""
    return not session.model.get("own") and _presents_german_mount(session) and status.wedge


def _meridian_reading() -> Handling:
    """Return the reading of the first axis of a fork on its wedge on the meridian, degrees."""
    return 180.0 if (yield op.GetSite()).latitude >= 0.0 else 0.0
