"""The data that all parts of a mount share: its line, its orders, its readings, its site and clock.

The parts that act on the mount get the context as an argument; the context has no reference to them.
"""

from __future__ import annotations

import asyncio

from gateway.astro.ephemeris.sky import Sky
from gateway.core import operations as op
from gateway.core.errors import Asleep, Busy, Fault, Held, NoAnswer
from gateway.core.motion_kinds import GOTOS, SEQUENTIAL_ORDERS, begins_motion
from gateway.core.waiting import BackgroundTasks
from gateway.core.wire_log import WireLog
from gateway.mount.link.line import MountLink
from gateway.mount.motion.run_on import RunOnWatch
from gateway.mount.motion.wanted import Movement, WantedState
from gateway.mount.policy import Hold, Policy
from gateway.mount.presence import ProgramId
from gateway.mount.readings.cache import POLL_PERIOD, ReadingsCache
from gateway.mount.safety.allow import StopTiming
from gateway.mount.safety.sync_sum import SyncTotal
from gateway.mount.site.astrometry import SiteAstrometry, SunAvoidance, TubeFrame
from gateway.mount.site.pending_settings import IncomingSettings
from gateway.mount.site.readers import SiteView
from gateway.mount.site.site_clock import SiteClock, SiteTimeSources
from gateway.protocols.base.driver import Driver, Remark

#: The rate of the mount's fastest motion.
FASTEST_RATE = op.Rate(name="max")


class Context:
    """The driver, the owner's policy, the log, the loop's clock, background tasks, and the shared values.

    `Identification` sets the events: ``replied`` after a first reply with a position, or with ``identified``;
    ``site_read`` after requests for site and clock. Shutdown sets the first two, and ``closed``: start nothing new.
    """

    def __init__(
        self, driver: Driver, policy: Policy, log: WireLog, link: MountLink, sky: Sky, site_clock: SiteClock
    ) -> None:
        self.driver, self.policy, self.log, self.link, self.site_clock = driver, policy, log, link, site_clock
        self.now = asyncio.get_running_loop().time
        self.tasks, self.closed = BackgroundTasks(), False
        self.replied, self.identified, self.site_read = asyncio.Event(), asyncio.Event(), asyncio.Event()
        self.cache, self.wanted = ReadingsCache(link), WantedState()
        self.movement, self.incoming_settings = Movement(self.wanted, self.cache), IncomingSettings()
        self.run_on = RunOnWatch(self.now)
        #: The best known site and time; the limits and horizon coordinates use them.
        self.sources = SiteTimeSources(site_clock)
        self.astrometry = SiteAstrometry(sky, self.sources, policy.equinox or "jnow")
        self.hold, self.syncs = Hold(), SyncTotal()
        self.tube_frame = TubeFrame(self.cache, driver, self.syncs, self.sources)
        self.suns = SunAvoidance(
            policy.limits.sun, self.astrometry, self.sources, self.now, self.tube_frame, self.site_read, self.note_once
        )

    def astrometry_for(self, program: ProgramId) -> SiteAstrometry:
        """Return astronomy with the site and clock that this program reads."""
        return SiteAstrometry(self.astrometry.sky, SiteView(self.site_clock, program), self.astrometry.equinox)

    def certain_fault(self, operation: op.Operation) -> Fault | None:
        """Return why an operation cannot succeed, as far as the gateway knows without asking the mount; else None."""
        driver, link, wanted = self.driver, self.link, self.wanted.value
        if link.state == "down" or (link.reply_is_overdue and not driver.asleep):
            return NoAnswer()
        if (driver.asleep or driver.powerless) and not self.wanted.wake_up_pending and begins_motion(operation):
            return Asleep()
        is_occupied = link.occupied or self.incoming_settings.type_being_sent is op.SetClock
        if is_occupied and begins_motion(operation) and not isinstance(operation, GOTOS):  # gotos may wait
            return Busy()
        try:
            if isinstance(operation, SEQUENTIAL_ORDERS):
                self.hold.check_allowed(operation)
        except Held as fault:
            return fault
        if not self.identified.is_set():
            return None
        nothing_waits = all(isinstance(order.operation, op.Pulse | op.PulseAxis) for order in wanted.pending)
        return driver.certain_fault(operation) if nothing_waits and not wanted.stop_owed else None

    @property
    def stop_timing(self) -> StopTiming:
        """How long a stop takes at the present speed of the line."""
        return StopTiming(
            self.link.times.typical_rtt, self.driver.position_reads, POLL_PERIOD[op.Position], self.policy.run_on
        )

    def note(self, text: str) -> None:
        """Log a line about the mount."""
        self.log.note("mount", text)

    def remark(self, remark: Remark) -> None:
        """Log the driver's remark that it did something else than requested, once for each kind or text of remark."""
        self.log.note_once("mount", remark.text, kind=remark.kind)

    def note_once(self, text: str, kind: str = "") -> None:
        """Log a line about the mount, unless this text, or a text of this ``kind``, was logged before."""
        self.log.note_once("mount", text, kind=kind)
