"""Collects what is known of a mount into one value, from cached readings, without asking the mount.

It holds what was asked for and by whom, the limits, the last readings, the state of the line, and recent refusals. The
status line, ``status`` and ``watch`` all show this value.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from gateway.app.status import Rate, State, StatusLine, format_position
from gateway.core import operations as op
from gateway.mount.motion.wanted import ByHand, Slew
from gateway.mount.presence import HostActivity
from gateway.mount.safety.admission.contradictions import contradictions, site_text

if TYPE_CHECKING:
    from gateway.mount.controller import MountController

#: Events of the last so many seconds are shown, and at most so many of them.
LATELY, MOST = 60.0, 10


def status_line(
    controller: MountController, name: str, mount: str, programs: int, rate: Rate | None = None
) -> StatusLine:
    """Return what the status line shows of a mount."""
    now, snapshot = controller.now(), controller.cache
    identity = snapshot.value(op.GetIdentity)
    called = mount if identity is None else identity.model or identity.product
    line, driver, run_on = controller.line, controller.driver, controller.context.run_on
    ends = controller.wanted.owed or run_on.value is not None
    # A mount that ran on after a stop was seen to move like one at its keys, until it was seen at rest.
    others = controller.watch.moved_by_others and controller.watch.others.seen_at > run_on.rested
    by_hand = bool(controller.wanted.axes) or (others and not ends)
    return StatusLine(
        name or called, line.state, line.reason, snapshot.value(op.Position), snapshot.age(op.Position, now),
        controller.slewing, by_hand, snapshot.value(op.GetStatus), programs,
        0.0 if rate is None else rate.per_second(now, line.answers), driver.asleep, controller.hold.on,
        ends, run_on.unknown,
    )  # fmt: skip


def collect_state(
    controller: MountController, name: str, mount: str, programs: Sequence[str], surfaces: Sequence[str] = ()
) -> State:
    """Return everything; ``programs`` are the hosts of connected programs, ``name`` is the mount's (or empty).

    With several ``surfaces``, their endpoints tell the programs of one computer apart.
    """
    identity: op.Identity | None = controller.cache.value(op.GetIdentity)
    who = (identity.product, identity.model, identity.version) if identity else ("", "", "")
    title = controller.driver.protocol.title(*who[:2])
    return State(
        status_line(controller, name, mount, len(programs)),
        mount,
        *who,
        tuple(_wanted(controller, surfaces)),
        tuple(_allowed(controller)),
        site(controller),
        clock(controller),
        tuple(sorted(programs)),
        controller.line.typical_rtt,
        controller.line.answers,
        tuple(_recent_events(controller)),
        title=title,
    )


def site(controller: MountController) -> str:
    """Return the site in use, its source and what contradicts it; empty if no site is known."""
    sites = controller.sources.sites()
    doubts = "".join(f"; {found.other}" for found in contradictions(sites, controller.sources.times()[:1]))
    return f"{site_text(sites[0].place)}, told by {sites[0].who.rstrip(',')}{doubts}" if sites else ""


def clock(controller: MountController) -> str:
    """Return the time in use and its source; empty if it is no valid date."""
    best = controller.sources.best_time()
    try:
        moment = datetime.datetime.fromtimestamp(best.unix, datetime.UTC)
    except (OverflowError, OSError, ValueError):  # a mount may report any year
        return ""
    doubts = "".join(f"; {found.words}" for found in contradictions([], controller.sources.times()))
    return f"{moment:%Y-%m-%d %H:%M:%S} UTC, told by {best.who}{doubts}"


def _wanted(controller: MountController, surfaces: Sequence[str]) -> Iterator[str]:
    """Yield what the mount was asked to do, by whom, and the orders that wait."""
    wanted = controller.wanted.value
    if wanted.owed:
        yield "a stop, which the mount has not acknowledged yet"
    if isinstance(wanted.motion, Slew):
        since = controller.now() - wanted.motion.since
        yield f"{_goto(controller, wanted.motion.operation)}{_asked_by(wanted.motion.by, since, surfaces)}"
    elif controller.slewing:
        yield "it slews without an order from this gateway: perhaps by its hand control"
    if wanted.short:
        yield wanted.short
    if controller.sun_ahead.words:
        yield controller.sun_ahead.words
    for axis, motion in wanted.motion if isinstance(wanted.motion, ByHand) else ():
        yield f"{_arrow(motion.operation, axis)}{_asked_by(motion.by, controller.now() - motion.since, surfaces)}"
    for order in wanted.pending:
        if not order.follow_up and order.number != wanted.active:
            asked = _asked_by(order.by, controller.now() - order.since, surfaces)
            yield f"{order.operation.title()}, not begun yet{asked}"


def _goto(controller: MountController, operation: op.Operation) -> str:
    if isinstance(operation, op.Goto):
        goal = controller.astrometry.from_mount(op.Equatorial(operation.ra, operation.dec))
        return f"a goto to {format_position(goal)}"
    if isinstance(operation, op.GotoHorizontal | op.GotoAxes):
        return f"a goto to azimuth {operation.az:.1f}°, altitude {operation.alt:.1f}°"
    return "the way to its park position" if isinstance(operation, op.Park) else "the way home"


def _arrow(operation: op.Move | op.MoveAxis, axis: int) -> str:
    if isinstance(operation, op.Move):
        return f"an arrow {operation.direction.word}"
    return f"motor {axis} {'forwards' if operation.sense > 0 else 'backwards'}"


def _asked_by(by: HostActivity | None, seconds: float, surfaces: Sequence[str]) -> str:
    number = 0 if by is None or len(surfaces) < 2 or by.who.startswith("pty:") else by.program.surface
    on = f" at {surfaces[number - 1]}" if 0 < number <= len(surfaces) else ""
    return f", asked for {seconds:.0f} s ago" + (f" by {by.who}{on}" if by is not None else "")


def _allowed(controller: MountController) -> Iterator[str]:
    limits = controller.policy.limits
    yield f"altitude {limits.lowest:g}° to {limits.highest:g}°"
    if limits.sun > 0.0:
        yield f"no nearer to the Sun than {limits.sun:g}°"
    if limits.hour_angle is not None:
        yield f"no more than {limits.hour_angle / 15.0:g} h past the meridian"
    yield f"syncs of up to {limits.sync:g}°"
    if controller.hold.on:
        yield "held: nothing moves it until mount-gateway stop --release"


def _recent_events(controller: MountController) -> Iterator[str]:
    """Yield refusals and actions of the gateway in the last minute; repeated messages are counted."""
    now = controller.wire_log.clock()
    counted: dict[tuple[str, str], tuple[int, float]] = {}
    for word in controller.wire_log.recent:
        if now - word.time <= LATELY:
            key = word.side, word.text
            counted[key] = (counted.pop(key, (0, 0.0))[0] + 1, word.time)
    for (side, text), (count, at) in list(counted.items())[-MOST:]:
        yield f"{now - at:.0f} s ago, {side}: {text}{f' ({count} times)' if count > 1 else ''}"
