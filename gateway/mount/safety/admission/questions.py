"""What is asked of the mount before a motion is decided on, because what it told last may not be enough."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.rules.axis_altitude import AltitudeAxis
from gateway.mount.safety.watch import LimitWatch


class Questions(NamedTuple):
    """Asks the mount: for what may be some seconds old, for what is true now, for the side that its tube is on."""

    read: Callable[[op.Operation], Awaitable[Any]]
    anew: Callable[[op.Operation], Awaitable[Any]]
    tube_side: Callable[[], Awaitable[str | None]]


async def tilt(mount: MountInputs, ask: Questions, axis: AltitudeAxis) -> float:
    """By how many degrees an axis that tells the altitude differs from what is reckoned; after a sync it is asked."""
    if axis.synced and not mount.moving().anything:
        await ask.anew(op.GetStatus())
        await ask.read(op.Position())
        await ask.anew(op.AxisPosition())
    return axis.tilt or 0.0


async def over(mount: MountInputs, ask: Questions, watch: LimitWatch) -> bool:
    """Whether the tube of a fork has been driven over the pole or the zenith, so that it points the other way."""
    if not mount.driver.way(op.AxisPosition):
        return not watch.upright
    here: op.Horizontal = await ask.read(op.AxisPosition())
    return abs(wrap180(here.alt)) > 90.0
