"""A fake mount that answers operations at once, for testing a surface by its bytes alone, without I/O.

It has no protocol and no time of its own. Gotos and syncs are checked against the product's limits; everything else
succeeds.
"""

from __future__ import annotations

import calendar
from copy import copy
from datetime import datetime
from functools import cache
from typing import Any

from gateway.app.bindings import make_surface
from gateway.app.config import Endpoint, SurfaceConfig
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import separation
from gateway.clients.commands.turn import COORDINATE_PAIR_WINDOW
from gateway.clients.profiles import SurfaceBinding
from gateway.core import operations as op
from gateway.core.errors import Fault, NoAnswer, SyncTooFar, Unsupported
from gateway.mount.policy import Limits
from gateway.mount.site.astrometry import SiteAstrometry
from gateway.mount.site.places import POSITION_FUNCTIONS
from gateway.mount.site.site_clock import SiteClock, SiteTimeSources
from gateway.protocols.base.session import Session
from gateway.protocols.base.wants import ChangeBaudRate, CheckPossible, Defer, FireAndForget, ReuseLastReading


@cache
def unix(text: str) -> float:
    """Convert ``2026-03-21 04:15:30`` (UTC) to Unix seconds."""
    return float(calendar.timegm(datetime.strptime(text, "%Y-%m-%d %H:%M:%S").timetuple()))


class Mount:
    """The answers to give, and the operations that were performed, in order."""

    def __init__(self) -> None:
        self.position = op.Equatorial(188.0 + 44 / 60, 45 + 12 / 60 + 34 / 3600)
        self.horizontal = op.Horizontal(180.0, 40.0)
        self.axes = op.Horizontal(90.0, 90.0)
        self.pier = "E"
        self.site = op.Place(37 + 17 / 60, -(122 + 25 / 60))
        self.clock = op.Moment(unix("2026-03-21 04:15:30"), -8.0)
        self.status = op.Status(op.Tracking.EQ_NORTH, aligned=True, equatorial=True)
        self.identity = op.Identity("Test mount", "4.21", "cpc")
        #: The answer of its GPS receiver; None if it has no receiver.
        self.gps: op.Gps | None = None
        #: The tracking rate as a multiple of sidereal.
        self.drive_rate = 1.0
        self.slewing = False
        self.limits = Limits()
        self.sky = Sky()
        self.asked: list[op.Operation] = []
        #: The fault that every operation, or one kind of operation, ends in.
        self.fault: Fault | None = None
        self.faults: dict[type[op.Operation], Fault] = {}

    def perform(self, operation: op.Operation) -> Any:
        """Return the answer of an operation. Raises the Fault that was set, or the one that the limits demand."""
        self.asked.append(operation)
        if self.fault is not None:
            raise self.fault
        if type(operation) in self.faults:
            raise self.faults[type(operation)]
        answers: dict[type[op.Operation], Any] = {
            op.Position: self.position,
            op.HorizontalPosition: self.horizontal,
            op.Slewing: self.slewing,
            op.GetStatus: self.status,
            op.GetSite: self.site,
            op.GetClock: self.clock,
            op.HomeState: 0,
            op.AxisPosition: self.axes,
            op.PierSide: self.pier,
            op.GetIdentity: self.identity,
            op.DriveRate: self.drive_rate,
        }
        if isinstance(operation, op.GetGps) and self.gps is not None:
            return self.gps
        if isinstance(operation, op.GetGps | op.GuideRate):
            raise Unsupported
        if type(operation) in POSITION_FUNCTIONS:
            site_clock = SiteClock(lambda: self.clock.unix, lambda: self.clock.unix, self.site)
            return POSITION_FUNCTIONS[type(operation)](
                SiteAstrometry(self.sky, SiteTimeSources(site_clock), "jnow"), operation
            )
        if isinstance(operation, op.SiderealTime):
            return self.sky.sidereal_time(self.clock.unix, self.site.longitude)
        if isinstance(operation, op.Goto):
            _, altitude = self.sky.az_alt(
                operation.ra, operation.dec, self.site.latitude, self.site.longitude, self.clock.unix
            )
            self.limits.narrowed(operation.lowest, operation.highest).check_altitude(altitude)
            self.slewing = True
        elif isinstance(operation, op.GotoHorizontal):
            self.limits.narrowed(operation.lowest, operation.highest).check_altitude(operation.alt)
            self.slewing = True
        elif isinstance(operation, op.GotoAxes):
            self.slewing = True
        elif isinstance(operation, op.Sync):
            if separation(self.position.ra, self.position.dec, operation.ra, operation.dec) > self.limits.sync:
                raise SyncTooFar
        elif isinstance(operation, op.AbortMotion | op.AbortSlew):
            self.slewing = False
        elif isinstance(operation, op.SetTracking):
            own = op.Tracking.EQ_NORTH if self.status.equatorial else op.Tracking.ALTAZ
            mode = (operation.mode or own) if operation.on else op.Tracking.OFF
            self.status = op.Status(mode, aligned=self.status.aligned, equatorial=self.status.equatorial)
        elif isinstance(operation, op.TrackRate):
            named = {"sidereal": 1.0, "solar": 0.99727, "lunar": 0.97633}
            self.drive_rate = named[operation.name] if operation.name else operation.factor or 0.0
        elif isinstance(operation, op.SetSite):
            self.site = op.Place(
                self.site.latitude if operation.latitude is None else operation.latitude,
                self.site.longitude if operation.longitude is None else operation.longitude,
            )
        elif isinstance(operation, op.SetClock):
            self.clock = op.Moment(operation.unix, operation.offset)
        if isinstance(operation, op.Read) and type(operation) not in answers:
            raise Unsupported  # as a mount that does not report it
        return answers.get(type(operation))

    def of(self, kind: type[op.Operation]) -> list[Any]:
        """Return the operations of this kind that were performed."""
        return [operation for operation in self.asked if isinstance(operation, kind)]


class Talk:
    """One client of a surface over a ``Mount``: bytes in, bytes out, no I/O."""

    def __init__(
        self,
        mount: Mount | None = None,
        model: str = "autostar",
        protocol: str = "lx200",
        version: str | None = None,
        **settings: Any,
    ) -> None:
        self.mount = mount or Mount()
        endpoint = Endpoint(protocol, "-", model, version)
        self.binding: SurfaceBinding = make_surface(endpoint, SurfaceConfig(at="-", **settings), Limits())
        self.now = self.mount.clock.unix
        self.session = self.binding.surface.session_type(self.binding.model, self.binding.settings, lambda: self.now)
        self.framer = self.binding.make_framer()
        self.deferred: list[tuple[float, Session, str]] = []
        self._told: dict[type[Any], tuple[float, Any]] = {}

    def send(self, data: bytes) -> bytes:
        """Send bytes and return everything that the surface replies to them."""
        reply = b""
        for frame in self.framer.feed(data, self.now):
            reply += self._handle(frame)
            self.session.last_frame = frame
        return reply

    def _handle(self, frame: bytes) -> bytes:
        return self._run(self.binding.surface.handle(self.session, frame), self.session) or b""

    def _run(self, steps: Any, session: Session) -> bytes | None:
        answer: Any = None
        fault: Fault | None = None
        try:
            while True:
                wanted = steps.send(answer) if fault is None else steps.throw(fault)
                answer, fault = None, None
                if isinstance(wanted, ChangeBaudRate):
                    continue
                if isinstance(wanted, CheckPossible):
                    fault = self.mount.fault if isinstance(self.mount.fault, NoAnswer) else None
                    continue
                if isinstance(wanted, Defer):
                    self.deferred = [item for item in self.deferred if item[1:] != (session, wanted.handler)]
                    self.deferred.append((self.now + wanted.seconds, session, wanted.handler))
                    continue
                try:
                    operation = wanted.operation if isinstance(wanted, FireAndForget | ReuseLastReading) else wanted
                    at, answer = self._told.get(type(operation), (-1e9, None))
                    if not (isinstance(wanted, ReuseLastReading) and self.now - at < COORDINATE_PAIR_WINDOW):
                        answer = self.mount.perform(operation)
                        self._told[type(operation)] = self.now, answer
                except Fault as error:
                    fault = None if isinstance(wanted, FireAndForget) else error
        except StopIteration as end:
            reply: bytes | None = end.value
            return reply

    def reconnect(self) -> None:
        """Close the connection and open the next one, which inherits what the session keeps across connections."""
        before = self.session
        self.session = type(before)(before.model, before.client_settings, before.clock, before.shared_settings)
        self.session.client = copy(before.client)
        self.framer = self.binding.make_framer()

    def wait(self, seconds: float) -> None:
        """Let time pass on the host and on the mount, and run each deferred handler at its time."""
        until = self.now + seconds
        while due := sorted((item for item in self.deferred if item[0] <= until), key=lambda item: item[0]):
            at, session, handler = due[0]
            self.deferred.remove(due[0])
            self._pass(at - self.now)
            self._run(self.binding.surface.handlers[handler](session, None, {}), session)  # type: ignore[arg-type]
        self._pass(until - self.now)

    def _pass(self, seconds: float) -> None:
        self.now += seconds
        self.mount.clock = op.Moment(self.mount.clock.unix + seconds, self.mount.clock.offset)
