"""What is asked of the mount before a motion is decided on, because what it told last may not be enough."""

from __future__ import annotations

from gateway.astro.spherical import wrap180
from gateway.core import operations as op
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.inputs import MountInputs
from gateway.mount.safety.rules.axis_altitude import AltitudeAxis
from gateway.mount.safety.watch import LimitWatch


async def tilt(mount: MountInputs, ask: Reader, axis: AltitudeAxis) -> float:
    """By how many degrees an axis that tells the altitude differs from what is reckoned; after a sync it is asked."""
    if axis.synced and not mount.moving().anything:
        await ask.anew(op.GetStatus())
        await ask.read(op.Position())
        await ask.anew(op.AxisPosition())
    return axis.tilt or 0.0


async def over(mount: MountInputs, ask: Reader, watch: LimitWatch) -> bool:
    """Whether the tube of a fork has been driven over the pole or the zenith, so that it points the other way."""
    if not mount.driver.way(op.AxisPosition):
        return not watch.upright
    here: op.Horizontal = await ask.read(op.AxisPosition())
    return abs(wrap180(here.alt)) > 90.0
