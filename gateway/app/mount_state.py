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
from gateway.mount.motion.wanted import ByHand, Slew, Wanted
from gateway.mount.policy import Policy
from gateway.mount.presence import HostActivity
from gateway.mount.safety.admission.contradictions import Contradiction, contradictions, site_text
from gateway.mount.safety.hour_angle import NO_LIMIT_MESSAGE, can_enforce_hour_angle
from gateway.mount.site.site_clock import Site, Time

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: Only events of the last so many seconds are shown, and at most so many of them.
RECENT_AGE, MAX_RECENT_EVENTS = 60.0, 10


class MountState(Struct, frozen=True, dict=True):
    """The state of a mount at the loop time ``now``; the computer's Unix time of that moment is a field, too.

    ``horizontal`` is its azimuth and altitude, ``goal`` the goal of a goto under way; both None if not known.
    ``programs`` are the hosts of connected programs; ``sites`` and ``times`` are all reported ones, best first. Other
    fields are how many replies the mount has sent, its typical reply time in seconds, whether a limit of the hour
    angle can be enforced, and the source of the calculated sky.
    """

    look: StatusLine
    mount: str
    identity: op.Identity | None
    title: str
    pier: str
    german: bool | None
    pier_kept: bool
    horizontal: op.Horizontal | None
    wanted: Wanted
    goal: op.Equatorial | op.Horizontal | None
    sun_ahead: str
    doubt: str
    policy: Policy
    sites: tuple[Site, ...]
    times: tuple[Time, ...]
    programs: tuple[str, ...]
    reply: float
    answers: int
    refusals: int
    notices: tuple[Notice, ...]
    sky: str
    now: float
    clock: float

    def drawn(self, surfaces: Sequence[str] = ()) -> State:
        """Return the state as texts for ``status``. Of several ``surfaces``, orders name the one they came by."""
        identity = self.identity
        return State(
            self.look,
            self.mount,
            *((identity.product, identity.model, identity.version) if identity else ("", "", "")),
            tuple(self._orders(surfaces)),
            tuple(self._allowed()),
            self.site,
            self.time,
            tuple(sorted(self.programs)),
            self.reply,
            self.answers,
            tuple(self._lately()),
            title=self.title,
            sky=self.sky,
        )

    @cached_property
    def site_doubts(self) -> list[Contradiction]:
        """The reports of other sources that differ from the site in use."""
        return list(contradictions(self.sites, self.times[:1]))

    @cached_property
    def clock_doubts(self) -> list[Contradiction]:
        """The reports of other sources that differ from the time in use."""
        return list(contradictions((), self.times))

    @property
    def site(self) -> str:
        """The site in use, its source and what contradicts it; empty if no site is known."""
        if not self.sites:
            return ""
        doubts = "".join(f"; {doubt.other}: {doubt.remedy}" for doubt in self.site_doubts)
        return f"{site_text(self.sites[0].place)}, from {self.sites[0].who.rstrip(',')}{doubts}"

    @property
    def time(self) -> str:
        """The time in use and its source; empty if it is no valid date."""
        best = self.times[0]
        try:
            moment = datetime.datetime.fromtimestamp(best.unix, datetime.UTC)
        except (OverflowError, OSError, ValueError):  # a mount may report any year
            return ""
        doubts = "".join(f"; {doubt.line}" for doubt in self.clock_doubts)
        return f"{moment:%Y-%m-%d %H:%M:%S} UTC, from {best.who}{doubts}"

    @property
    def goal_text(self) -> str:
        """The goal of a goto under way as text; empty if there is none, or only the mount knows it."""
        if isinstance(self.goal, op.Horizontal):
            return f"azimuth {self.goal.az:.1f}°, altitude {self.goal.alt:.1f}°"
        return "" if self.goal is None else format_position(self.goal)

    def _orders(self, surfaces: Sequence[str]) -> Iterator[str]:
        """Yield the orders under way, with the clients that gave them, and the waiting orders."""

        def asked(by: HostActivity | None, asked_at: float) -> str:
            number = 0 if by is None or len(surfaces) < 2 or by.who.startswith("pty:") else by.program.surface
            on = f" at {surfaces[number - 1]}" if 0 < number <= len(surfaces) else ""
            return f", asked for {self.now - asked_at:.0f} s ago" + (f" by {by.who}{on}" if by is not None else "")

        wanted, motion = self.wanted, self.wanted.motion
        if wanted.owed:
            yield "a stop, which the mount has not acknowledged yet"
        if isinstance(motion, Slew):
            home = "the way to its park position" if isinstance(motion.operation, op.Park) else "the way home"
            yield (f"a goto to {self.goal_text}" if self.goal else home) + asked(motion.by, motion.since)
        elif self.look.slewing:
            yield "it slews, but not for this gateway: perhaps by its hand control"
        yield from filter(None, (wanted.short, self.sun_ahead, self.doubt))
        for axis, moving in motion if isinstance(motion, ByHand) else ():
            tube = self.look.status is not None and not self.look.status.equatorial
            yield _arrow(moving.operation, axis, tube) + asked(moving.by, moving.since)
        for order in wanted.pending:
            if not order.follow_up and order.number != wanted.active:
                yield f"{order.operation.title()}, not begun yet{asked(order.by, order.since)}"

    def _allowed(self) -> Iterator[str]:
        limits = self.policy.limits
        yield from (limits if self.pier_kept else replace(limits, hour_angle=None)).as_text()
        if limits.hour_angle is not None and not self.pier_kept:
            yield NO_LIMIT_MESSAGE
        if limits.by_page:
            yield "narrowed by a page of the console, until the gateway ends"
        yield f"syncs of up to {limits.sync:g}°"
        if self.look.held:
            yield "held: nothing moves it until it is released (mount-gateway stop --release)"

    def _lately(self) -> Iterator[str]:
        """Yield refusals and actions of the gateway in the last minute; repeated messages are counted."""
        counted: dict[tuple[str, str], tuple[int, float]] = {}
        for notice in self.notices:
            if self.clock - notice.time <= RECENT_AGE:
                key = notice.side, notice.text
                counted[key] = (counted.pop(key, (0, 0.0))[0] + 1, notice.time)
        for (side, text), (count, at) in list(counted.items())[-MAX_RECENT_EVENTS:]:
            yield f"{self.clock - at:.0f} s ago, {side}: {text}{f' ({count} times)' if count > 1 else ''}"


def mount_state(
    controller: MountController, name: str = "", mount: str = "", programs: Sequence[str] = ()
) -> MountState:
    """Return the state of a mount; ``name`` is its configured name, or empty."""
    now, readings, astrometry, driver = controller.now(), controller.cache, controller.astrometry, controller.driver
    identity: op.Identity | None = readings.value(op.GetIdentity)
    product, model = (identity.product, identity.model) if identity else ("", "")
    position: op.Equatorial | None = readings.value(op.Position)
    line, wanted, run_on = controller.line, controller.wanted, controller.context.run_on
    ends = wanted.owed or run_on.value is not None
    # A mount that ran on after a stop seemed to be moved at its keys, until its position showed rest.
    others = controller.watch.moved_by_others and controller.watch.others.seen_at > run_on.rested
    by_hand = bool(wanted.axes) or (others and not ends)
    look = StatusLine(
        name or (mount if identity is None else model or product), line.state, line.reason, position,
        readings.age(op.Position, now), controller.slewing, by_hand, readings.last(op.GetStatus), len(programs),
        0.0, driver.asleep, controller.hold.on, ends, run_on.unknown, driver.parked,
    )  # fmt: skip
    sites, times = tuple(controller.sources.sites()), tuple(controller.sources.times())
    return MountState(
        look=look,
        mount=mount,
        identity=identity,
        title=driver.protocol.title(product, model),
        pier=readings.value(op.PierSide) or "",
        german=driver.german,
        pier_kept=identity is None or can_enforce_hour_angle(controller.context),
        horizontal=astrometry.horizon(position) if sites and position is not None else None,
        wanted=wanted.value,
        goal=_goal(controller),
        sun_ahead=controller.sun_ahead.warning,
        doubt=controller.synced.doubt,
        policy=controller.policy,
        sites=sites,
        times=times,
        programs=tuple(programs),
        reply=line.times.typical_rtt,
        answers=line.times.answers,
        refusals=controller.wire_log.refusals,
        notices=tuple(controller.wire_log.recent),
        sky=astrometry.sky.source(times[0].unix),
        now=now,
        clock=controller.wire_log.clock(),
    )


def _goal(controller: MountController) -> op.Equatorial | op.Horizontal | None:
    motion = controller.wanted.value.motion
    operation = motion.operation if isinstance(motion, Slew) else None
    if isinstance(operation, op.Goto):
        return controller.astrometry.from_mount(op.Equatorial(operation.ra, operation.dec))
    return (
        op.Horizontal(operation.az, operation.alt) if isinstance(operation, op.GotoHorizontal | op.GotoAxes) else None
    )


#: What the arrows of an alt-azimuth mount do to its tube.
_TUBE_DIRECTIONS = {"north": "up", "south": "down", "east": "left", "west": "right"}


def _arrow(operation: op.Move | op.MoveAxis, axis: int, tube: bool) -> str:
    """Return the text for an arrow: with ``tube`` up, down, left or right (alt-azimuth), else as on the sky."""
    if isinstance(operation, op.Move):
        word = operation.direction.word
        return f"an arrow {_TUBE_DIRECTIONS[word] if tube else word}"
    return f"motor {axis} {'forwards' if operation.sense > 0 else 'backwards'}"
