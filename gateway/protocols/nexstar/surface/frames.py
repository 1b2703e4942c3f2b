"""Axis readings of the mount as the presented hand control has them, and back.

Of an alt-az fork they are azimuth and altitude. A fork on its wedge reads from north, where its azimuth axis points at
the elevated pole: 180 on the meridian in the north, 0 in the south, and it never turns over the pole (Celestron renamed
its menu to Axis Position for that; INDI parks at 90, 90). A German mount reads its hour angle. Over a German mount that
is presented as a fork by its name, azimuth and altitude stay those of the sky, as rotator software wants them.
"""

from __future__ import annotations

from gateway.astro.spherical import wrap180, wrap360
from gateway.core import operations as op
from gateway.protocols.base.wants import Handling
from gateway.protocols.nexstar.session import NexStarSession


def german(session: NexStarSession) -> bool:
    """Whether the presented mount is equatorial by its build."""
    return bool(session.model["mount"] == "german")


def readings(session: NexStarSession) -> Handling:
    """-> Horizontal: what the two axes read on what is presented."""
    status: op.Status = yield op.GetStatus()
    if not _turned(session, status):
        return (yield op.AxisPosition() if _by_axes(session, status) else op.HorizontalPosition())
    seen: op.Horizontal = yield op.AxisPosition()
    return op.Horizontal(wrap360(seen.az - (yield from _zero())), seen.alt)


def to_mount(session: NexStarSession, first: float, second: float) -> Handling:
    """-> the goto that turns both axes to these readings of what is presented."""
    status: op.Status = yield op.GetStatus()
    if not _turned(session, status):
        return op.GotoAxes(first, second) if _by_axes(session, status) else op.GotoHorizontal(first % 360.0, second)
    second = wrap180(second)
    if abs(second) > 90.0:  # a German mount on the other side of its pier; a fork does not turn over the pole
        first, second = first + 180.0, wrap180(180.0 - second)
    return op.GotoAxes(wrap360(first + (yield from _zero())), second)


def _by_axes(session: NexStarSession, status: op.Status) -> bool:
    """Whether this hand control counts by its motors; where it is the mount's own, as that does."""
    return status.equatorial if session.model.get("own") else german(session) or status.wedge


def _turned(session: NexStarSession, status: op.Status) -> bool:
    """Whether a fork on its wedge is presented as a German mount."""
    return not session.model.get("own") and german(session) and status.wedge


def _zero() -> Handling:
    """What the first axis of a fork on its wedge reads on the meridian."""
    return 180.0 if (yield op.GetSite()).latitude >= 0.0 else 0.0
