"""Admission of a sync: its turn of the axes must stay within ``sync-limit``, and the mount must be at rest.

A sync while the mount moves is refused, because nothing is centred then. Clients that compare positions consider a goto
ended a moment too early. So a sync on the target of the goto waits for its end; a sync on any other object is refused
at once. Motors run on after a stop: a sync waits for rest, and is refused if the mount does not come to rest.
"""

from __future__ import annotations

import asyncio

from gateway.astro.axes import Pair
from gateway.astro.spherical import separation, wrap180
from gateway.core import operations as op
from gateway.core.errors import Refused, Stopped
from gateway.mount.context import Context
from gateway.mount.motion.wanted import Slew
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import ReadingSource
from gateway.mount.safety.admission.by_hand import find_pointings
from gateway.mount.safety.admission.slew_paths import axis_readings_at
from gateway.mount.safety.sync_sum import SyncSum, checked_sync_sum
from gateway.mount.safety.watch import LimitWatch

#: Seconds that a sync waits for the end of a goto, or for rest, and between two checks.
GOTO_END_WAIT, CHECK_PERIOD = 2.5, 0.2
#: Degrees from the pole or zenith within which a mount may believe after a sync that its axes point the other way.
POLE_DISTANCE = 1.0
MOVING_MESSAGE = "The mount is moving, so nothing is centred: sync when it has stopped."
#: Degrees by which a sync may differ from the target of its goto: positions may be coarse, and equinoxes differ.
SAME_TARGET_DEGREES = 0.5


async def admit_sync(
    mount: Context, readings: ReadingSource, watch: LimitWatch, sync: op.Sync, activity: HostActivity | None
) -> op.Operation:
    """Return the sync in the mount's equinox, and note the new sum of syncs. Raises Refused, SyncTooFar, Stopped.

    ``activity`` is the client's connection: if it is closed while the sync waits, the sync is dropped.
    """
    if mount.movement.slewing:
        await _wait_for_goto_end(mount, readings, sync, activity)
    if mount.movement.any_motion or not await _comes_to_rest(mount, readings, watch):
        raise Refused(MOVING_MESSAGE)
    status: op.Status = await readings.read(op.GetStatus())
    if status.aligned:
        position: op.Equatorial = await readings.read(op.Position())
        wanted, so_far = op.Equatorial(sync.ra, sync.dec), mount.syncs.value
        turns = await _sync_turns(mount, readings, watch, position, wanted, status.equatorial)
        mount.syncs.pending = checked_sync_sum(mount.policy.limits.sync, so_far, turns, position, wanted)
    else:  # it aligns the mount
        mount.syncs.pending = SyncSum()
    return mount.astrometry.to_mount_equinox(sync)


async def _comes_to_rest(mount: Context, readings: ReadingSource, watch: LimitWatch) -> bool:
    """Return whether the mount, which runs on after a stop or is moved at its hand control, soon comes to rest."""
    until = mount.now() + GOTO_END_WAIT
    while mount.run_on.current is not None or watch.others_watch.is_moving:
        if mount.now() >= until:
            return False
        await readings.read_now(op.Position())
        await asyncio.sleep(CHECK_PERIOD)
    return not mount.movement.any_motion


async def _sync_turns(
    mount: Context,
    reads: ReadingSource,
    watch: LimitWatch,
    position: op.Equatorial,
    target: op.Equatorial,
    equatorial: bool,
) -> list[Pair]:
    """Return by how many degrees a sync turns the readings of the two axes. There is a second pair if the mount may
    believe afterwards that it points in the other of the two ways, for example after motion by hand over the pole.

    In the other way (beyond the pole or the zenith, or on the other side of the pier) the second axis turns reversely.
    """
    driver, by_sky, others = mount.driver, mount.driver.emulates_sync, {False}
    start, end = (axis_readings_at(mount.astrometry, place, equatorial or by_sky) for place in (position, target))
    axes_reported = driver.implementation(op.AxisPosition) is not None
    if not by_sky:  # else the driver syncs by an offset
        others = await find_pointings(mount, reads, watch)
    if driver.german and not axes_reported and watch.observed.upright and len(others) > 1:
        others = {wrap180(start[0]) < 0.0}  # without a report the mount has chosen its side by the hour angle
    first, sense = wrap180(end[0] - start[0]), 1.0 if False in others else -1.0
    turns = [(first, sense * (end[1] - start[1]))]
    doubtful = len(others) > 1 or driver.reports_beyond_pole or start[1] > 90.0 - POLE_DISTANCE
    if doubtful and not by_sky:
        turns.append((wrap180(first + 180.0), wrap180(sense * (180.0 - end[1] - start[1]))))
    return turns


async def _wait_for_goto_end(
    mount: Context, readings: ReadingSource, sync: op.Sync, activity: HostActivity | None
) -> None:
    """Wait briefly for the end of a goto to the target of the sync. Raises Refused, Stopped."""
    until = mount.now() + GOTO_END_WAIT
    while mount.movement.slewing:
        if not _is_goto_target(mount, sync) or mount.now() >= until:
            raise Refused(MOVING_MESSAGE)
        if not await readings.read_now(op.Slewing()):
            break
        await asyncio.sleep(CHECK_PERIOD)
    if activity is not None and activity.closed_at is not None:
        raise Stopped
    position: op.Equatorial = await readings.read(op.Position())
    if separation(position.ra, position.dec, sync.ra, sync.dec) > 2.0 * SAME_TARGET_DEGREES:
        raise Refused("The goto ended elsewhere, so nothing is centred: send the mount there again.")


def _is_goto_target(mount: Context, sync: op.Sync) -> bool:
    """Whether a sync names the target of the goto under way; False if that is unknown."""
    motion, status, astrometry = mount.wanted.value.motion, mount.cache.last_value(op.GetStatus), mount.astrometry
    goto = motion.operation if isinstance(motion, Slew) else None
    if isinstance(goto, op.Goto):
        goal = astrometry.from_mount_equinox(op.Equatorial(goto.ra, goto.dec))
    elif isinstance(goto, op.GotoAxes | op.GotoHorizontal) and status is not None and not status.equatorial:
        goal = astrometry.equatorial_of(goto)  # the axes of a fork are azimuth and altitude
    else:
        return False
    return separation(goal.ra, goal.dec, sync.ra, sync.dec) <= SAME_TARGET_DEGREES
