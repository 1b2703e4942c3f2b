"""A mount that stands still and answers what it is told to: for testing a surface by its bytes alone.

It has no protocol and no time of its own. Gotos and syncs are judged by the product's limits, everything else succeeds.
"""

from __future__ import annotations

import calendar
from datetime import datetime
from typing import Any

from gateway import operations as op
from gateway.assembly import FACES
from gateway.config import Endpoint, SurfaceConfig
from gateway.errors import Fault
from gateway.guests import Face
from gateway.safety import Limits, check_altitude, check_sync
from gateway.sky import Sky
from gateway.surface import Defer, Session, Start


def unix(text: str) -> float:
    """``2026-03-21 04:15:30`` (UTC) -> Unix seconds."""
    return float(calendar.timegm(datetime.strptime(text, "%Y-%m-%d %H:%M:%S").timetuple()))


class Mount:
    """What the surface is told, and what it asked for, in order."""

    def __init__(self) -> None:
        self.position = op.Equatorial(188.0 + 44 / 60, 45 + 12 / 60 + 34 / 3600)
        self.horizontal = op.Horizontal(180.0, 40.0)
        self.site = op.Place(37 + 17 / 60, -(122 + 25 / 60))
        self.clock = op.Moment(unix("2026-03-21 04:15:30"), -8.0)
        self.status = op.Status(op.Tracking.EQ_NORTH, aligned=True, equatorial=True)
        self.slewing = False
        self.limits = Limits()
        self.sky = Sky()
        self.asked: list[op.Operation] = []
        self.fault: Fault | None = None

    def perform(self, operation: op.Operation) -> Any:
        """The answer of an operation; raises the Fault that was set, or what the limits say."""
        self.asked.append(operation)
        if self.fault is not None:
            raise self.fault
        answers: dict[type[op.Operation], Any] = {
            op.Position: self.position, op.HorizontalPosition: self.horizontal, op.Slewing: self.slewing,
            op.GetStatus: self.status, op.GetSite: self.site, op.GetClock: self.clock, op.HomeState: 0,
        }
        if isinstance(operation, op.SiderealTime):
            return self.sky.sidereal_time(self.clock.unix, self.site.longitude)
        if isinstance(operation, op.Goto):
            _, altitude = self.sky.horizon(operation.ra, operation.dec, self.site.latitude, self.site.longitude,
                                           self.clock.unix)
            check_altitude(self.limits.narrowed(operation.lowest, operation.highest), altitude)
            self.slewing = True
        elif isinstance(operation, op.GotoHorizontal):
            check_altitude(self.limits.narrowed(operation.lowest, operation.highest), operation.alt)
        elif isinstance(operation, op.Sync):
            check_sync(self.limits, self.position, op.Equatorial(operation.ra, operation.dec))
        elif isinstance(operation, op.Stop):
            self.slewing = False
        elif isinstance(operation, op.SetSite):
            self.site = op.Place(
                self.site.latitude if operation.latitude is None else operation.latitude,
                self.site.longitude if operation.longitude is None else operation.longitude,
            )
        elif isinstance(operation, op.SetClock):
            self.clock = op.Moment(operation.unix, operation.offset)
        return answers.get(type(operation))

    def of(self, kind: type[op.Operation]) -> list[Any]:
        """The operations of a kind that were asked for."""
        return [operation for operation in self.asked if isinstance(operation, kind)]


class Talk:
    """One client of a surface over a ``Mount``: bytes in, bytes out, no I/O."""

    def __init__(self, mount: Mount | None = None, model: str = "autostar", protocol: str = "lx200",
                 **settings: Any) -> None:
        self.mount = mount or Mount()
        self.face: Face = FACES[protocol](Endpoint(protocol, "-", model), SurfaceConfig(at="-", **settings), Limits())
        self.now = self.mount.clock.unix
        self.session = Session(self.face.model, self.face.settings, lambda: self.now, {"sites": {}})
        self.framer = self.face.framer()
        self.deferred: list[Defer] = []

    def send(self, data: bytes) -> bytes:
        """Everything the surface answers to these bytes."""
        reply = b""
        for frame in self.framer.feed(data):
            reply += self._handle(frame)
            self.session.last = frame
        return reply

    def _handle(self, frame: bytes) -> bytes:
        return self._run(self.face.surface.handle(self.session, frame)) or b""

    def _run(self, steps: Any) -> bytes | None:
        answer: Any = None
        fault: Fault | None = None
        try:
            while True:
                wanted = steps.send(answer) if fault is None else steps.throw(fault)
                answer, fault = None, None
                if isinstance(wanted, Defer):
                    self.deferred.append(wanted)
                    continue
                try:
                    answer = self.mount.perform(wanted.operation if isinstance(wanted, Start) else wanted)
                except Fault as error:
                    fault = None if isinstance(wanted, Start) else error
        except StopIteration as end:
            return end.value

    def wait(self, seconds: float) -> None:
        """Let time pass: what was deferred until then is done."""
        self.now += seconds
        self.mount.clock = op.Moment(self.mount.clock.unix + seconds, self.mount.clock.offset)
        due, self.deferred = self.deferred, []
        for wanted in due:
            self._run(self.face.surface.specials[wanted.special](self.session, None, {}))  # type: ignore[arg-type]
