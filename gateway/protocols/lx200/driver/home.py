"""Home, park and sleep.

While a Meade seeks its home it accepts only :Q# and :h?#, so ``ask`` sends nothing else until the search has ended.
Operations for which a model has no command are refused by the rows of ``driver.toml``.
"""

from __future__ import annotations

import contextlib

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer, Refused, Unsupported
from gateway.protocols.base.driver import Schedule, Steps, Wait
from gateway.protocols.lx200.driver.dialect import read_report
from gateway.protocols.lx200.driver.drive import set_drive_rate, set_tracking, switch_pec
from gateway.protocols.lx200.driver.ends import MOUNT_AXES, count_motion, restore_rates_later
from gateway.protocols.lx200.driver.identify import ask_repeatedly, read_status
from gateway.protocols.lx200.driver.pointing import begin_goto, is_seeking_home, stop_current_motion
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

#: Seconds from ending other motion to the search for home, and between two checks whether the search has ended.
SETTLE_TIME, HOME_CHECK_INTERVAL = 0.5, 2.0


class CheckHomeSearch(op.Operation, frozen=True):
    """Internal: check whether the search for home has ended."""


def park(mount: Lx200Driver, _: op.Park) -> Steps:
    """:hP - park; the telescope turns its drives off when it has arrived."""
    yield from stop_current_motion(mount)
    yield from begin_goto(mount, "hP", purpose="park")


def seek_home(mount: Lx200Driver, operation: op.Home | op.SetHome) -> Steps:
    """Search for home by :hF, or by :hS, which also stores the positions of the home switches.

    A mount that reported no name is asked for it again first, because an OnStep takes :hF as "this is home".
    """
    nameless = not mount.product and mount.named_model is None
    if nameless and (yield from ask_repeatedly(mount, "GVP", 2)) is not None:
        raise Refused("The mount has reported its name only now. Reconnect it to identify it.")
    yield from stop_current_motion(mount)
    mount.seeking = True  # from here on no other command is sent; requests in the queue are answered first
    yield Wait(SETTLE_TIME)
    count_motion(mount, *MOUNT_AXES)
    try:
        yield from ask(mount, "hS" if isinstance(operation, op.SetHome) else "hF")
    except Fault:
        mount.seeking = False
        raise
    mount.seeking = True
    yield Schedule(HOME_CHECK_INTERVAL, CheckHomeSearch())


def check_home_search(mount: Lx200Driver, _: CheckHomeSearch) -> Steps:
    """Check whether the search for home has ended, for which other commands wait; if not, schedule another check."""
    if not mount.seeking:
        return
    with contextlib.suppress(Busy, NoAnswer):
        if not (yield from is_seeking_home(mount)):
            return
    yield Schedule(HOME_CHECK_INTERVAL, CheckHomeSearch())


def go_home(mount: Lx200Driver, _: op.Home) -> Steps:
    """:hC - a goto to the home position of another maker's mount, which needs no search."""
    yield from stop_current_motion(mount)
    yield from begin_goto(mount, "hC", purpose="home")


def home_state(mount: Lx200Driver, _: op.HomeState) -> Steps:
    """:h? -> 0 failed, 1 found, 2 searching. Another maker's mount: 1 at home or parked, 2 on the way there, else 0."""
    if mount.dialect:
        if mount.goto is not None and mount.goto.purpose:
            return 2
        state = yield from read_report(mount)
        return int(state.at_home or state.parked)
    return int((yield from ask(mount, "h?"))["state"])


def unpark(mount: Lx200Driver, _: op.Unpark) -> Steps:
    """:I wakes a parked LX200GPS, :hR another maker's mount; then read the status and turn tracking on if possible.

    Raises Unsupported if a parked telescope reports no status and has no command to unpark.
    """
    if mount.supports("hR"):
        yield from read_status(mount)
        if mount.parked:
            yield from ask(mount, "hR")
    elif mount.parked and mount.supports("I"):
        with contextlib.suppress(NoAnswer):
            yield from ask(mount, "I")
        corrected = mount.pec_axes
        mount.reset_state()  # :I restarts the telescope with its default rates, and without corrections
        if mount.drive_rate is not None:
            yield from set_drive_rate(mount, mount.drive_rate)
        for axis in sorted(corrected):
            yield from switch_pec(mount, op.PeriodicError(axis, True))
        yield from restore_rates_later(mount)
    elif mount.parked and not mount.has_status:
        raise Unsupported("This telescope has no command to unpark: the next goto unparks it.")
    mount.parked = False
    yield from read_status(mount)
    if mount.has_status and mount.tracking is op.Tracking.OFF:
        yield from set_tracking(mount, op.SetTracking(on=True))


def sleep(mount: Lx200Driver, _: op.Hibernate) -> Steps:
    """:hN - sleep; no motion is sent afterwards, because a sleeping telescope would accept it and not move."""
    yield from ask(mount, "hN")
    mount.powerless = True


def wake(mount: Lx200Driver, _: op.Wake) -> Steps:
    """:hW - wake from sleep."""
    yield from ask(mount, "hW")
    mount.powerless = False
