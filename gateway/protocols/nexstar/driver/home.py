"""Park, home and sleep.

A hand control has no park position of its own: it is sent to one by ``b``, and its tracking goes off when it is there.
It sleeps and wakes by ``x`` and ``y`` where the firmware has them, else tracking goes off and on. A hand control that
wakes goes on tracking; some are late with that, so it is told to a little later, unless it was told something else
about tracking meanwhile.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Unsupported
from gateway.protocols.base.driver import Schedule, Send, Steps
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.pointing import MOTORS, axis_readings, stop_current_motion, to_axes
from gateway.protocols.nexstar.driver.state import GotoState, NexStar

#: Seconds from ``y`` until it is told to track.
AWAKE = 2.0


def park(mount: NexStar, operation: op.Park) -> Steps:
    """To the park position by ``b`` (which works unaligned too); tracking goes off when it is there."""
    mount.woken = False
    yield from stop_current_motion(mount)
    there = mount.destination(operation)
    assert there is not None
    yield from to_axes(mount, there.az, there.alt, "park")


def set_home(mount: NexStar, _: op.SetHome) -> Steps:
    """Remember where the axes stand now."""
    answer = yield axis_readings(mount)
    mount.home, mount.home_state = op.Horizontal(answer["az"], answer["alt"]), 1


def home(mount: NexStar, _: op.Home) -> Steps:
    """To the stored home position; to the motors' switches where they have some and the settings say so."""
    if mount.settings.aux_home and mount.has("home"):
        yield from _seek_switches(mount)
        return
    if mount.home is None:
        mount.home_state = 0
        raise Unsupported("No home position was stored.")
    yield from stop_current_motion(mount)
    mount.home_state = 2
    yield from to_axes(mount, mount.home.az, mount.home.alt, "home")


def _seek_switches(mount: NexStar) -> Steps:
    """AUX 0x0B on both motors (never 0x19, which seeks the index of the periodic error)."""
    yield from stop_current_motion(mount)
    yield from tracking.suspend(mount)
    mount.parked, mount.home_state = False, 2
    mount.goto = GotoState(since=mount.now(), then="home", seeks=True)
    for device in MOTORS:
        yield Send("level_start", {"device": device})


def home_state(mount: NexStar, _: op.HomeState) -> Steps:
    """-> 2 on the way, 1 at home or parked, 0 else."""
    yield from ()  # a generator like all others
    if mount.goto is not None and mount.goto.then in ("home", "park"):
        return 2
    return 1 if mount.parked else mount.home_state


def unpark(mount: NexStar, _: op.Unpark) -> Steps:
    """Tracking on again, the mount's state read anew."""
    mount.parked = False
    if mount.goto is None and mount.supports("T") and tracking.native_mode(mount) is not None:
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
    yield from tracking.read_status(mount)


def sleep(mount: NexStar, _: op.Hibernate) -> Steps:
    """``x`` where the firmware has it, else tracking off."""
    if mount.supports("x"):
        try:
            yield Send("x")
        except NoAnswer:
            if not mount.asleep:  # else it sleeps already, and does not answer that either
                raise
        mount.asleep, mount.woken = True, False
        mount.at_rest()
        mount.suspended = None  # it wakes tracking
    else:
        yield from tracking.set_tracking(mount, op.SetTracking(on=False))


class Awake(op.Operation, frozen=True):
    """Internal: it was woken, and goes on tracking; not where it was told something else about that meanwhile."""

    survives_abort = True


def awake(mount: NexStar, _: Awake) -> Steps:
    """Some seconds after ``y``."""
    if mount.woken:
        mount.woken = False
        yield from unpark(mount, op.Unpark())


def wake(mount: NexStar, _: op.Wake) -> Steps:
    """``y`` where the firmware has it, else tracking on."""
    if mount.supports("y"):
        yield Send("y")
        mount.asleep, mount.woken = False, True
        yield Schedule(AWAKE, Awake())
    else:
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
