"""The rules that keep a mount within its limits, put together: what they may know, what watches, what admits."""

from __future__ import annotations

from gateway.core import operations as op
from gateway.mount.context import Context
from gateway.mount.link.line import MountLink
from gateway.mount.motion.ends import EndWatch
from gateway.mount.motion.wanted import Movement
from gateway.mount.policy import Hold
from gateway.mount.readings.cache import ReadingsCache
from gateway.mount.readings.reader import Reader
from gateway.mount.safety.admission.contradictions import doubts
from gateway.mount.safety.admission.motions import Admission
from gateway.mount.safety.sun import SunAvoidance
from gateway.mount.safety.sync_sum import SyncTotal
from gateway.mount.safety.view import MountInputs
from gateway.mount.safety.watch import LimitWatch
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.mount.site.settings_sync import SyncSettings
from gateway.mount.site.site_clock import BestSources


class Safety:
    """``watch`` looks at every position, ``admission`` decides on a motion before it begins."""

    def __init__(
        self,
        context: Context,
        link: MountLink,
        cache: ReadingsCache,
        reader: Reader,
        movement: Movement,
        astrometry: SiteAstrometry,
        sources: BestSources,
        suns: SunAvoidance,
        sync: SyncSettings,
    ) -> None:
        self._sources = sources
        self.inputs = MountInputs(
            context.driver,
            context.now,
            cache,
            astrometry,
            suns,
            movement.now,
            context,
            lambda: link.typical,
            lambda: sync.sets_sky,
        )
        self.hold, self.synced = Hold(), SyncTotal()
        self.ends = EndWatch(context.now, context.note)
        self.watch = LimitWatch(self.inputs, reader, self.ends, self.synced)
        self.admission = Admission(self.inputs, reader, self.watch, sources, self.synced, self.hold)
        reader.goto_over.connect(self.watch.arrived)
        reader.position.connect(self.watch.look)
        reader.axes.connect(self.watch.look_at_altitude)
        reader.unseen.connect(self.watch.unseen)
        reader.status.connect(self._status_came)

    def _status_came(self, status: op.Status) -> None:
        if not status.aligned:
            self.synced.forget()

    def doubts(self) -> str:
        """What does not fit together, in one line; nothing where all fits."""
        return doubts(self.inputs, self._sources)
