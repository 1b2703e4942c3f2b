"""``MountState``: what one mount does and what is known of it at one moment, without asking the mount.

Only this module makes it, from the cached readings. The status line, ``status`` and ``watch``, the page, MQTT and the
metrics all use it, so they cannot contradict each other. It contains values; its methods turn some into sentences.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from msgspec import Struct
from msgspec.structs import replace

from gateway.app.status import State, StatusLine, format_position
from gateway.core import operations as op
from gateway.core.wire_log import Notice
from gateway.mount.motion.wanted import HandMove, Slew, Wanted
from gateway.mount.policy import Policy
from gateway.mount.presence import HostActivity
from gateway.mount.safety.admission.contradictions import Contradiction, contradictions, site_text
from gateway.mount.safety.hour_angle import NO_LIMIT_MESSAGE, mount_suits_hour_angle_limit
from gateway.mount.site.site_clock import SourcedSite, SourcedTime

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: Only events of the last so many seconds are shown, and at most so many of them.
RECENT_AGE, MAX_RECENT_EVENTS = 60.0, 10


class MountState(Struct, frozen=True, dict=True):
    """The state of a mount at the loop time ``now``; ``unix_time`` is the computer's Unix time at that moment.

    ``horizontal`` is its azimuth and altitude, ``goal`` the goal of a goto under way; both None if not known.
    ``programs`` are the hosts of connected programs; ``sites`` and ``times`` are all reported ones, best first.
    ``reply_count`` is how many replies the mount has sent, ``reply_time`` its typical reply time in seconds.
    ``sky_source`` names what the sky is calculated from: an almanac or a closed form.
    """

    look: StatusLine
    mount: str
    identity: op.Identity | None
    title: str
    pier_side: str
    german: bool | None
    can_enforce_hour_angle: bool
    horizontal: op.Horizontal | None
    wanted: Wanted
    goal: op.Equatorial | op.Horizontal | None
    sun_warning: str
    sync_warning: str
    policy: Policy
    sites: tuple[SourcedSite, ...]
    times: tuple[SourcedTime, ...]
    programs: tuple[str, ...]
    reply_time: float
    reply_count: int
    refusals: int
    notices: tuple[Notice, ...]
    sky_source: str
    now: float
    unix_time: float

    def to_state(self, surfaces: Sequence[str] = ()) -> State:
        """Return the state as texts for ``status``; if there are several ``surfaces``, each order names its surface."""
        identity = self.identity
        return State(
            self.look,
            self.mount,
            *((identity.product, identity.model, identity.version) if identity else ("", "", "")),
            tuple(self._order_texts(surfaces)),
            tuple(self._limit_texts()),
            self.site,
            self.time,
            tuple(sorted(self.programs)),
            self.reply_time,
            self.reply_count,
            tuple(self._recent_event_texts()),
            title=self.title,
            sky=self.sky_source,
        )

    @cached_property
    def site_contradictions(self) -> list[Contradiction]:
        """The reports of other sources that differ too much from the site in use."""
        return list(contradictions(self.sites, self.times[:1]))

    @cached_property
    def clock_contradictions(self) -> list[Contradiction]:
        """The reports of other sources that differ too much from the time in use."""
        return list(contradictions((), self.times))

    @property
    def site(self) -> str:
        """The site in use, its source and what contradicts it; empty if no site is known."""
        if not self.sites:
            return ""
        doubts = "".join(f"; {doubt.short_text}: {doubt.remedy}" for doubt in self.site_contradictions)
        return f"{site_text(self.sites[0].place)}, from {self.sites[0].source_text.rstrip(',')}{doubts}"

    @property
    def time(self) -> str:
        """The time in use, its source and what contradicts it; empty if it is no valid date."""
        best = self.times[0]
        try:
            moment = datetime.datetime.fromtimestamp(best.unix, datetime.UTC)
        except (OverflowError, OSError, ValueError):  # a mount may report any year
            return ""
        doubts = "".join(f"; {doubt.warning_line}" for doubt in self.clock_contradictions)
        return f"{moment:%Y-%m-%d %H:%M:%S} UTC, from {best.source_text}{doubts}"

    @property
    def goal_text(self) -> str:
        """The goal of a goto under way as text; empty if there is none, or only the mount knows it."""
        if isinstance(self.goal, op.Horizontal):
            return f"azimuth {self.goal.az:.1f}°, altitude {self.goal.alt:.1f}°"
        return "" if self.goal is None else format_position(self.goal)

    def _order_texts(self, surfaces: Sequence[str]) -> Iterator[str]:
        """Yield the orders under way and waiting, with their clients; a slew by others; and warnings about motion."""

        def origin(by: HostActivity | None, asked_at: float) -> str:
            number = 0 if by is None or len(surfaces) < 2 or by.host.startswith("pty:") else by.program.surface_number
            on = f" at {surfaces[number - 1]}" if 0 < number <= len(surfaces) else ""
            return f", asked for {self.now - asked_at:.0f} s ago" + (f" by {by.host}{on}" if by is not None else "")

        wanted, motion = self.wanted, self.wanted.motion
        if wanted.stop_owed:
            yield "a stop, which the mount has not acknowledged yet"
        if isinstance(motion, Slew):
            home = "the way to its park position" if isinstance(motion.operation, op.Park) else "the way home"
            yield (f"a goto to {self.goal_text}" if self.goal else home) + origin(motion.client, motion.began_at)
        elif self.look.slewing:
            yield "it slews, but not for this gateway: perhaps by its hand control"
        yield from filter(None, (wanted.goto_failure, self.sun_warning, self.sync_warning))
        for axis, moving in motion if isinstance(motion, HandMove) else ():
            tube = self.look.status is not None and not self.look.status.equatorial
            yield _arrow_text(moving.operation, axis, tube) + origin(moving.client, moving.began_at)
        for order in wanted.pending:
            if not order.follow_up and order.number != wanted.active:
                yield f"{order.operation.title()}, not begun yet{origin(order.client, order.came_at)}"

    def _limit_texts(self) -> Iterator[str]:
        limits = self.policy.limits
        yield from (limits if self.can_enforce_hour_angle else replace(limits, hour_angle=None)).as_text()
        if limits.hour_angle is not None and not self.can_enforce_hour_angle:
            yield NO_LIMIT_MESSAGE
        if limits.by_page:
            yield "narrowed by a page of the console, until the gateway ends"
        yield f"syncs of up to {limits.sync:g}°"
        if self.look.held:
            yield "held: nothing moves it until it is released (mount-gateway stop --release)"

    def _recent_event_texts(self) -> Iterator[str]:
        """Yield the last MAX_RECENT_EVENTS refusals and actions of the last minute; repeated messages are counted."""
        counted: dict[tuple[str, str], tuple[int, float]] = {}
        for notice in self.notices:
            if self.unix_time - notice.time <= RECENT_AGE:
                key = notice.side, notice.text
                counted[key] = (counted.pop(key, (0, 0.0))[0] + 1, notice.time)
        for (side, text), (count, at) in list(counted.items())[-MAX_RECENT_EVENTS:]:
            yield f"{self.unix_time - at:.0f} s ago, {side}: {text}{f' ({count} times)' if count > 1 else ''}"


def mount_state(
    controller: MountController, name: str = "", mount: str = "", programs: Sequence[str] = ()
) -> MountState:
    """Return the state of a mount; ``name`` is its configured name or empty, ``mount`` its endpoint."""
    now, readings, astrometry, driver = controller.now(), controller.cache, controller.astrometry, controller.driver
    identity: op.Identity | None = readings.last_value(op.GetIdentity)
    product, model = (identity.product, identity.model) if identity else ("", "")
    position: op.Equatorial | None = readings.last_value(op.Position)
    line, wanted, run_on = controller.line, controller.wanted, controller.context.run_on
    ends = wanted.stop_owed or run_on.current is not None
    # A mount that ran on after a stop seemed to be moved at its keys, until its position showed rest.
    others = controller.watch.moved_by_others and controller.watch.others_watch.last_seen_at > run_on.rested_at
    by_hand = bool(wanted.axes_moved_by_hand) or (others and not ends)
    look = StatusLine(
        name or (mount if identity is None else model or product), line.state, line.down_cause, position,
        readings.age(op.Position, now), controller.slewing, by_hand, readings.last_or_forgotten(op.GetStatus),
        len(programs), 0.0, driver.asleep, controller.hold.is_on, ends, run_on.motion_unknown, driver.parked,
    )  # fmt: skip
    sites, times = tuple(controller.sources.sites()), tuple(controller.sources.times())
    return MountState(
        look=look,
        mount=mount,
        identity=identity,
        title=driver.protocol.model_title(product, model),
        pier_side=readings.last_value(op.PierSide) or "",
        german=driver.german,
        can_enforce_hour_angle=identity is None or mount_suits_hour_angle_limit(controller.context),
        horizontal=astrometry.horizontal(position) if sites and position is not None else None,
        wanted=wanted.value,
        goal=_goal_of(controller),
        sun_warning=controller.sun_approach_watch.warning,
        sync_warning=controller.syncs.resync_reason,
        policy=controller.policy,
        sites=sites,
        times=times,
        programs=tuple(programs),
        reply_time=line.times.typical_rtt,
        reply_count=line.times.reply_count,
        refusals=controller.wire_log.refusal_count,
        notices=tuple(controller.wire_log.recent_notices),
        sky_source=astrometry.sky.calculation_source(times[0].unix),
        now=now,
        unix_time=controller.wire_log.clock(),
    )


def _goal_of(controller: MountController) -> op.Equatorial | op.Horizontal | None:
    motion = controller.wanted.value.motion
    operation = motion.operation if isinstance(motion, Slew) else None
    if isinstance(operation, op.Goto):
        return controller.astrometry.from_mount_equinox(op.Equatorial(operation.ra, operation.dec))
    return (
        op.Horizontal(operation.az, operation.alt) if isinstance(operation, op.GotoHorizontal | op.GotoAxes) else None
    )


#: What the arrows of an alt-azimuth mount do to its tube.
_TUBE_DIRECTIONS = {"north": "up", "south": "down", "east": "left", "west": "right"}


def _arrow_text(operation: op.Move | op.MoveAxis, axis: int, moves_tube: bool) -> str:
    """Return an arrow's text: up, down, left or right with ``moves_tube``; else a point of the compass, or a motor."""
    if isinstance(operation, op.Move):
        word = operation.direction.label
        return f"an arrow {_TUBE_DIRECTIONS[word] if moves_tube else word}"
    return f"motor {axis} {'forwards' if operation.sense > 0 else 'backwards'}"
