"""Park, home, hibernate and wake.

A hand control has no park position: the gateway slews by ``b`` to a configured or default one and turns tracking off on
arrival. ``x`` and ``y`` hibernate and wake it if the firmware has them; otherwise tracking is turned off and on. Some
hand controls resume tracking late after ``y``: so tracking is turned on a little later, unless a client has changed it.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import NoAnswer, Unsupported
from gateway.protocols.base.driver import Schedule, Send, Steps
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.pointing import MOTOR_DEVICES, axis_position, slew_axes, stop_current_motion
from gateway.protocols.nexstar.driver.state import NexStar, NexStarGotoState

#: Seconds from ``y`` until tracking is turned on.
WAKE_DELAY = 2.0


def park(mount: NexStar, operation: op.Park) -> Steps:
    """Slew to the park position by ``b`` (which also works unaligned); tracking is turned off on arrival."""
    mount.was_woken = False
    yield from stop_current_motion(mount)
    goal = mount.destination(operation)
    assert goal is not None
    yield from slew_axes(mount, goal.az, goal.alt, "park")


def set_home(mount: NexStar, _: op.SetHome) -> Steps:
    """Store the present axis readings as the home position."""
    mount.home_axes, mount.home_state = (yield from axis_position(mount, op.AxisPosition())), 1


def go_home(mount: NexStar, _: op.Home) -> Steps:
    """Slew to the stored home position, or seek the home switches if so configured. Raises Unsupported."""
    if mount.settings.aux_home and mount.has_part("home"):
        yield from _seek_home_switches(mount)
        return
    if mount.home_axes is None:
        mount.home_state = 0
        raise Unsupported("No home position was stored.")
    yield from stop_current_motion(mount)
    mount.home_state = 2
    yield from slew_axes(mount, mount.home_axes.az, mount.home_axes.alt, "home")


def _seek_home_switches(mount: NexStar) -> Steps:
    """Send AUX 0x0B to both motors (never 0x19, which seeks the index of the periodic error correction)."""
    yield from stop_current_motion(mount)
    yield from tracking.suspend(mount)
    mount.parked, mount.home_state = False, 2
    mount.goto = NexStarGotoState(began=mount.now(), purpose="home", seeks_switches=True)
    for device in MOTOR_DEVICES:
        yield Send("level_start", {"device": device})


def home_state(mount: NexStar, _: op.HomeState) -> Steps:
    """Return 2 on the way home or to park, 1 at home or parked, else 0."""
    yield from ()  # a generator like all others
    if mount.goto is not None and mount.goto.purpose in ("home", "park"):
        return 2
    return 1 if mount.parked else mount.home_state


def unpark(mount: NexStar, _: op.Unpark) -> Steps:
    """Turn tracking on again and read the mount's status."""
    mount.parked = False
    if mount.goto is None and mount.supports("T") and tracking.native_mode(mount) is not None:
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
    yield from tracking.read_status(mount)


def sleep(mount: NexStar, _: op.Hibernate) -> Steps:
    """Hibernate by ``x`` if the firmware has it, else turn tracking off."""
    if mount.supports("x"):
        try:
            yield Send("x")
        except NoAnswer:
            if not mount.asleep:  # a mount that already hibernates does not answer
                raise
        mount.asleep, mount.was_woken = True, False
        mount.record_at_rest()
        mount.suspended_mode = None  # it tracks when it wakes
    else:
        yield from tracking.set_tracking(mount, op.SetTracking(on=False))


class TrackAfterWake(op.Operation, frozen=True):
    """Internal: turn tracking on after waking, unless a client has changed it meanwhile."""

    survives_abort = True


def track_after_wake(mount: NexStar, _: TrackAfterWake) -> Steps:
    """Turn tracking on some seconds after ``y``."""
    if mount.was_woken:
        mount.was_woken = False
        yield from unpark(mount, op.Unpark())


def wake(mount: NexStar, _: op.Wake) -> Steps:
    """Wake by ``y`` if the firmware has it, else turn tracking on."""
    if mount.supports("y"):
        yield Send("y")
        mount.asleep, mount.was_woken = False, True
        yield Schedule(WAKE_DELAY, TrackAfterWake())
    else:
        yield from tracking.set_tracking(mount, op.SetTracking(on=True))
