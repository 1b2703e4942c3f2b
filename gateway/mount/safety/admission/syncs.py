"""Admission of a sync: what it turns must stay within ``sync-limit``, and the mount must be at rest.

A sync that arrives while something moves is refused, because nothing is centered then. Clients that compare positions
take a goto for ended a moment too early, so a sync on its own target waits for its end; on any other object it is
refused at once.
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
from gateway.mount.readings.cache import Readings
from gateway.mount.safety.admission.by_hand import pointing
from gateway.mount.safety.admission.slew_paths import sun_reading
from gateway.mount.safety.sync_sum import SyncSum, check_sync
from gateway.mount.safety.watch import LimitWatch

#: Seconds that a sync waits for the end of a goto, and between two checks.
GOTO_END, CHECK_EVERY = 2.5, 0.2
MOVING = "The mount is moving, so nothing is centred: sync when it has stopped."
#: Degrees by which a sync may differ from the target of the goto under way: low precision, and equinoxes differ.
SAME_TARGET = 0.5


async def admit_sync(
    mount: Context, ask: Readings, watch: LimitWatch, sync: op.Sync, by: HostActivity | None
) -> op.Operation:
    """Return the sync in the mount's equinox, and note the sum with it. Raises Refused, SyncTooFar, Stopped.

    ``by`` is the client's connection: a sync that has waited is not done if it is closed.
    """
    if mount.movement.slewing:
        await _wait_for_goto_end(mount, ask, sync, by)
    if mount.movement.anything:
        raise Refused(MOVING)
    status: op.Status = await ask.read(op.GetStatus())
    if status.aligned:
        here: op.Equatorial = await ask.read(op.Position())
        wanted, so_far = op.Equatorial(sync.ra, sync.dec), mount.synced.value
        by_day, pole = bool(mount.suns.up()), "pole" if status.equatorial else "zenith"
        then = so_far.added(here, wanted, await _turn(mount, ask, watch, here, wanted, status.equatorial))
        check_sync(mount.policy.limits.sync, so_far, then, here, wanted, by_day, pole)
        mount.synced.coming = then
    else:  # it aligns the mount
        mount.synced.coming = SyncSum()
    return mount.astrometry.to_mount(sync)


async def _turn(
    mount: Context, ask: Readings, watch: LimitWatch, here: op.Equatorial, wanted: op.Equatorial, equatorial: bool
) -> Pair:
    """Return by how many degrees a sync turns the readings of the two axes.

    Beyond the pole or the zenith, also on the other side of the pier, the second axis turns the other way. If a German
    mount does not tell its side, it is the one that it chooses there.
    """
    by_sky = mount.driver.emulates_sync  # by an offset of right ascension and declination
    start, end = (sun_reading(mount.astrometry, place, equatorial or by_sky) for place in (here, wanted))
    first, second = wrap180(end[0] - start[0]), end[1] - start[1]
    return first, -second if not by_sky and await _beyond(mount, ask, watch, start[0]) else second


async def _beyond(mount: Context, ask: Readings, watch: LimitWatch, first: float) -> bool:
    """Whether the tube is beyond the pole or the zenith; without asking a fork, whose last axis reading says it."""
    if not mount.driver.german:
        axes = mount.cache.value(op.AxisPosition)
        return not watch.seen.upright if axes is None else abs(wrap180(axes.alt)) > 90.0
    others = await pointing(mount, ask, watch)
    return wrap180(first) < 0.0 if len(others) > 1 else True in others


async def _wait_for_goto_end(mount: Context, ask: Readings, sync: op.Sync, by: HostActivity | None) -> None:
    """Wait briefly for the end of a goto to the target of the sync. Raises Refused, Stopped."""
    until = mount.now() + GOTO_END
    while mount.movement.slewing:
        if not _is_target(mount, sync) or mount.now() >= until:
            raise Refused(MOVING)
        if not await ask.read_now(op.Slewing()):
            break
        await asyncio.sleep(CHECK_EVERY)
    if by is not None and by.closed is not None:
        raise Stopped
    here: op.Equatorial = await ask.read(op.Position())
    if separation(here.ra, here.dec, sync.ra, sync.dec) > 2.0 * SAME_TARGET:
        raise Refused("The goto ended elsewhere, so nothing is centred: send the mount there again.")


def _is_target(mount: Context, sync: op.Sync) -> bool:
    """Whether a sync names the target of the goto under way; False if that is unknown."""
    motion, status, astrometry = mount.wanted.value.motion, mount.cache.value(op.GetStatus), mount.astrometry
    goto = motion.operation if isinstance(motion, Slew) else None
    if isinstance(goto, op.Goto):
        goal = astrometry.from_mount(op.Equatorial(goto.ra, goto.dec))
    elif isinstance(goto, op.GotoAxes | op.GotoHorizontal) and status is not None and not status.equatorial:
        goal = astrometry.equatorial(goto)  # the axes of a fork are azimuth and altitude
    else:
        return False
    return separation(goal.ra, goal.dec, sync.ra, sync.dec) <= SAME_TARGET
