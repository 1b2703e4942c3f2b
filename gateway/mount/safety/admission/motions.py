"""Admission: decides before a motion whether it is allowed, and in which form this mount can carry it out.

A mount on hold (``mount-gateway stop --hold``) may not be moved at all. Otherwise this checks the target of every goto,
park and home, and the paths to it (``slew_paths.py``); motion by hand and guide pulses (``by_hand.py``); and syncs
(``syncs.py``). ``watch.py`` watches motion that has begun.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

from msgspec.structs import replace

from gateway.astro.axes import Build, Geometry, Pair
from gateway.astro.spherical import fold_declination, separation, wrap360
from gateway.core import operations as op
from gateway.core.errors import BelowHorizon, Fault, NearSun, NotAligned, TooHigh, Unsupported, WayBlocked
from gateway.core.motion_kinds import GOTOS
from gateway.mount.context import FASTEST_RATE, Context
from gateway.mount.motion.run_on import SKY_SPEED
from gateway.mount.policy import PARK_TIP, Limits, check_unknown_park
from gateway.mount.presence import HostActivity
from gateway.mount.readings.cache import LastReadings, NotRead, ReadingSource
from gateway.mount.safety.admission import slew_paths
from gateway.mount.safety.admission.altitudes import check_goal
from gateway.mount.safety.admission.by_hand import HandAdmission, find_pointings
from gateway.mount.safety.admission.contradictions import NO_TIME_TEXT, contradictions_of, is_time_unknown, sun_refusal
from gateway.mount.safety.admission.slew_paths import Journey, all_paths_within, are_clear, check_paths, paths_of
from gateway.mount.safety.admission.syncs import admit_sync
from gateway.mount.safety.allow import LOST_GOTO_DEGREES, CheckedPath
from gateway.mount.safety.hour_angle import LEVEL_SHAFT_ANGLE, check_past_meridian
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.astrometry import SyncShift

#: Why a telescope does not seek its home by day.
NO_HOME_BY_DAY = "It reports nothing while it seeks home. Cover the tube and seek home at the hand control, or park."
#: Seconds that a goto takes in addition to the time for its path at full speed.
SETTLE_TIME = 3.0
#: Seconds that a goto waits at most until site and clock of a newly connected mount are read: the limits need them.
SITE_TIMEOUT = 4.0


class MotionAdmission:
    """Admits the motions of a mount; the reconciler calls ``admit`` before each. ``preview`` predicts the outcome."""

    def __init__(self, mount: Context, readings: ReadingSource, watch: LimitWatch, is_preview: bool = False) -> None:
        """If it only previews outcomes (``is_preview``), it changes neither the log nor the watched limits."""
        self._mount, self._readings, self._watch = mount, readings, watch
        self._path = CheckedPath() if is_preview else watch.next_path
        self._note_once: Callable[[str], None] = (lambda text: None) if is_preview else mount.note_once
        self._hand_admission = HandAdmission(mount, readings, watch)

    async def preview(self, goal: op.Equatorial) -> Fault | None:
        """Return the refusal that a goto to ``goal`` would get now, by the same rules; None if they allow it.

        The rules use the last readings. If they need a missing reading, only the goto itself shows the outcome.
        """
        rules = MotionAdmission(
            self._mount, LastReadings(self._mount.cache, self._mount.driver), self._watch, is_preview=True
        )
        try:
            await rules._admit(op.Goto(goal.ra, goal.dec))
        except NotRead:
            return None
        except Fault as fault:
            return fault
        return None

    async def admit(self, operation: op.Operation, activity: HostActivity | None = None) -> op.Operation:
        """Return the operation in the form that this mount can carry out. Raises Fault if the rules forbid it.

        ``activity`` is the client's connection.
        """
        if isinstance(operation, GOTOS):
            with contextlib.suppress(TimeoutError):  # a mount is asked for site and clock right after it was identified
                async with asyncio.timeout(SITE_TIMEOUT):
                    await self._mount.site_read.wait()
        return await self._admit(operation, activity)

    async def _admit(self, operation: op.Operation, activity: HostActivity | None = None) -> op.Operation:
        self._mount.hold.check_allowed(operation)
        self._path.forget()
        await self._check_aligned(operation)
        seeks = isinstance(operation, op.Home | op.SetHome) and self._mount.driver.no_position_while_homing
        if seeks and self._mount.suns.suns_to_avoid():
            raise NearSun(NO_HOME_BY_DAY)
        if isinstance(operation, op.Move | op.MoveAxis):
            await self._hand_admission.check_motion(operation)
        elif isinstance(operation, op.Pulse | op.PulseAxis):
            await self._hand_admission.check_pulse(operation)
        elif isinstance(operation, op.Park | op.Home):
            try:
                await self._check_park_or_home(operation)
            except Fault:
                self._mount.driver.on_home_refusal()
                raise
        elif isinstance(operation, op.GotoHorizontal):
            return await self._admit_horizontal(operation)
        elif isinstance(operation, op.GotoAxes):
            if not self._mount.driver.implementation(op.AxisPosition) and (await self._status()).equatorial:
                goal = self._mount.astrometry.from_axes(operation, on_wedge=not self._mount.driver.german)
                return await self._admit(op.Goto(goal.ra, goal.dec))
            await self._check_axis_goto(operation, self._mount.policy.limits)
        elif isinstance(operation, op.Goto):
            return await self._admit_goto(operation)
        elif isinstance(operation, op.Sync):
            return await admit_sync(self._mount, self._readings, self._watch, operation, activity)
        elif isinstance(operation, op.Choose):
            return self._mount.astrometry.to_mount_equinox(operation)
        return operation

    async def check_motion_under_way(self) -> None:
        """Check that the motion by hand under way may continue. Raises the errors of ``HandAdmission.check_motion``."""
        moving = next(iter(self._mount.wanted.hand_moves.values()), None)
        if moving is not None:  # this checks the other axis, too
            await self._hand_admission.check_motion(moving)

    async def _status(self) -> op.Status:
        return await self._readings.read(op.GetStatus())

    async def _check_aligned(self, operation: op.Operation) -> None:
        """Raises NotAligned if the operation needs an aligned mount and this mount is not aligned."""
        if not needs_alignment(operation, self._mount.driver.sync_aligns, self._mount.policy.unaligned):
            return
        if not (await self._status()).aligned:
            fresh: op.Status = await self._readings.read_now(op.GetStatus())  # it may have been aligned just now
            if not fresh.aligned:
                raise NotAligned

    # --- gotos ------------------------------------------------------------------------------------------------------

    async def _admit_goto(self, operation: op.Goto) -> op.Operation:
        mount, goal = self._mount, op.Equatorial(operation.ra, operation.dec)
        limits = mount.policy.limits.narrowed(operation.lowest, operation.highest)
        await self._check_path(limits, goal, self._check_target(limits, goal))
        return mount.astrometry.to_mount_equinox(operation)

    async def _admit_horizontal(self, operation: op.GotoHorizontal) -> op.Operation:
        mount = self._mount
        mount.policy.limits.narrowed(operation.lowest, operation.highest).check_altitude(operation.alt)
        status = await self._status()
        rests = status.tracking is op.Tracking.OFF
        by_axes = not status.equatorial and mount.driver.implementation(op.GotoAxes)
        if by_axes and not any(mount.driver.sync_offset):
            return await self._admit(op.GotoAxes(operation.az, operation.alt, operation.fastest))
        goal = mount.astrometry.equatorial_of(operation)
        if by_axes and rests:
            east, north = mount.driver.sync_offset
            goal_axes = mount.astrometry.horizontal(op.Equatorial(*fold_declination(goal.ra - east, goal.dec - north)))
            return await self._admit(op.GotoAxes(goal_axes.az, goal_axes.alt, operation.fastest))
        goto = op.Goto(goal.ra, goal.dec, fastest=operation.fastest)
        if status.equatorial and status.aligned and rests:
            return await self._admit_untracked_goto(operation, goto)
        return await self._admit(goto)

    async def _admit_untracked_goto(self, operation: op.GotoHorizontal, goto: op.Goto) -> op.Operation:
        """Return the goto of an equatorial mount to an azimuth and altitude while tracking is off. A driver
        that can do so goes there itself. Else it is a goto to axis readings, calculated from the present ones, or, if
        the mount reports none, to the celestial coordinates that this direction will have on arrival.
        """
        mount = self._mount
        if mount.driver.implementation(op.GotoHorizontal):
            await self._admit_goto(goto)
            return operation
        if mount.driver.implementation(op.GotoAxes) and mount.driver.implementation(op.AxisPosition):
            await self._admit_goto(goto)
            position: op.Equatorial = await self._readings.read_now(op.Position())
            reads: op.Horizontal = await self._readings.read_now(op.AxisPosition())
            geometry = Geometry(Build.GERMAN if mount.driver.german else Build.WEDGE, mount.astrometry.site().latitude)
            sidereal = mount.astrometry.sidereal_time()
            first, second = geometry.axis_readings(
                (sidereal - position.ra, position.dec), (reads.az, reads.alt), (sidereal - goto.ra, goto.dec)
            )
            return op.GotoAxes(wrap360(first), second, operation.fastest)
        position = await self._readings.read_now(op.Position())
        seconds = SETTLE_TIME + separation(position.ra, position.dec, goto.ra, goto.dec) / (
            operation.fastest or mount.driver.speed(FASTEST_RATE)
        )
        return await self._admit_goto(replace(goto, ra=(goto.ra + SKY_SPEED * seconds) % 360.0, track=False))

    async def _check_park_or_home(self, operation: op.Park | op.Home) -> None:
        """Check the goal of a park or home; the owner's park position may have any altitude. Raises Fault."""
        mount, limits = self._mount, self._mount.policy.limits
        if isinstance(operation, op.Park):
            await self._status()  # the park position depends on the kind of mounting
            if mount.policy.own_park:
                limits = limits.without_altitudes()
        destination = mount.driver.destination(operation)
        if destination is None:
            check_unknown_park(operation, limits)
            self._path.points = []  # it may go anywhere
            return
        try:
            await self._check_axis_goto(destination, limits)
        except WayBlocked:
            raise
        except (BelowHorizon, TooHigh) as fault:
            raise type(fault)(f"{fault} {PARK_TIP}" if isinstance(operation, op.Park) else str(fault)) from None

    def _check_target(self, limits: Limits, goal: op.Equatorial) -> float | None:
        """Check a target by the mount's own site and clock, and its altitude also by every other source, but then only
        against limits that the user has set. Return the altitude; None if the site is unknown.

        Raises BelowHorizon, TooHigh, Contradicted or PastMeridian; NearSun if the time is unknown.
        """
        mount, altitude = self._mount, None
        if mount.sources.site() is None:
            self._note_once("site unknown: gotos are not checked against the horizon")
        else:
            altitude = check_goal(mount, limits, goal)
            status = mount.cache.last_value(op.GetStatus) if limits.hour_angle is not None else None
            if status is not None and status.equatorial and mount.driver.german is False:  # others choose a side
                check_past_meridian(limits, mount.astrometry.sidereal_time() - goal.ra, german=False)
        if limits.sun > 0.0 and is_time_unknown(mount.sources.times()[0]):
            raise NearSun(NO_TIME_TEXT, "The time is unknown. Set the clock, or sun = 0 at night.")
        return altitude

    async def _check_axis_goto(self, goto: op.GotoAxes, limits: Limits) -> None:
        """Check a goto to axis readings: the altitude and the hour angle at its goal, and its paths. Raises Fault."""
        mount = self._mount
        if not (await self._status()).equatorial:
            limits.check_altitude(goto.alt)
            if mount.sources.site() is not None:
                await self._check_path(limits, mount.astrometry.equatorial_of(goto), goto.alt, (goto.az, goto.alt))
            return
        try:
            goal = mount.astrometry.from_axes(goto, on_wedge=not mount.driver.german)
        except Unsupported:
            self._note_once("site unknown: axis gotos are not checked")
            return
        altitude = mount.astrometry.horizontal(goal).alt
        limits.check_altitude(altitude)
        turned = goto.az - LEVEL_SHAFT_ANGLE if mount.driver.german else mount.astrometry.sidereal_time() - goal.ra
        check_past_meridian(limits, turned, mount.driver.german)
        await self._check_path(limits, goal, altitude, (goto.az, goto.alt))

    async def _check_path(
        self, limits: Limits, goal: op.Equatorial, altitude: float | None, target_readings: Pair | None = None
    ) -> None:
        """Check a goal and the paths to it for the Sun, and the paths for altitude limits that the user has set. Store
        the paths for ``LimitWatch``. Raises NearSun, or WayBlocked as ``check_paths`` does.

        ``altitude`` is that of the goal, None without a site. A path that begins too near to the Sun is allowed if it
        never comes nearer. Before the alignment the direction of the tube is unknown, so only the goal is checked.
        """
        mount, astrometry, written = self._mount, self._mount.astrometry, limits.without_default_altitudes()
        limit, suns = mount.suns.min_dist, mount.suns.suns_to_avoid()
        for sun in suns:
            if mount.suns.distance(goal, sun) < limit:
                raise sun_refusal(mount.sources, sun)
        status = await self._status()
        if not status.aligned:
            return
        # if another clock or site is the mount's, its path differs from the calculated one
        lost_margin = 180.0 if any(contradictions_of(mount)) else LOST_GOTO_DEGREES
        if not (suns or status.equatorial or written.lowest > -90.0 or written.highest < 90.0):
            if altitude is not None:
                last = self._watch.observed.last
                begins = altitude if last is None or last.altitude is None else last.altitude
                self._path.min_altitude = min(0.0, begins - lost_margin, altitude - lost_margin)
                self._path.allowed = limits.hour_angle is None
            return
        others = await find_pointings(self._mount, self._readings, self._watch)
        position: op.Equatorial = await self._readings.read(op.Position())

        def journey_of(shift: SyncShift | None) -> Journey:
            """Return the journey if the tube's true direction differs from the mount's coordinates by ``shift``."""
            start, end = mount.suns.pointing(position, shift), mount.suns.pointing(goal, shift)
            return Journey(status.equatorial, start, others, end, target_readings if shift is None else None)

        for sun in suns:
            place = slew_paths.axis_readings_at(astrometry, sun, status.equatorial)
            if not are_clear(paths_of(mount, journey_of(sun.sync_shift)), place, limit):
                raise sun_refusal(mount.sources, sun, on_path=True)
        if mount.sources.site() is None:
            return
        for sky, sun in slew_paths.contradicting_suns(mount) if suns and not status.equatorial else ():
            place = slew_paths.axis_readings_at(sky, sun, False)
            if not are_clear(paths_of(mount, journey_of(None)._replace(sky=sky)), place, limit):
                raise sun_refusal(mount.sources, sun, on_path=True)
        unsynced = [journey_of(shift) for shift in mount.tube_frame().shifts]
        ways = check_paths(mount, written, journey_of(None), unsynced)
        self._path.set_points(
            [point for way in ways for point in slew_paths.path_points(way)],
            slew_paths.zenith_readings(mount, status.equatorial)[0],
            all(all_paths_within(mount, written, path) for path in unsynced),
            lost_margin,
        )
        # the hour angle on the way is not examined
        others_leave = len(ways) < len(paths_of(mount, journey_of(None)))
        self._path.allowed = self._path.allowed and not others_leave and limits.hour_angle is None


def needs_alignment(operation: op.Operation, sync_aligns: bool, unaligned_policy: str) -> bool:
    """Whether the operation requires an aligned mount. ``unaligned_policy``: the owner's setting for axis gotos.

    A hand control that is not aligned acknowledges every command and does nothing, or moves unpredictably.
    """
    by_axes = isinstance(operation, op.GotoAxes | op.GotoHorizontal | op.Park | op.Home)
    if sync_aligns or not (by_axes or isinstance(operation, op.Sync)):
        return False
    return not (by_axes and unaligned_policy == "allow")
