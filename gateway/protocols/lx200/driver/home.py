"""Home, park and sleep.

While it seeks its home a Meade hears :Q# and :h?# alone, so nothing else is sent until it has found it (``ask`` sees to
that). What a model has no command for, the rows refuse.
"""

from __future__ import annotations

import contextlib

from gateway.core import operations as op
from gateway.core.errors import Busy, Fault, NoAnswer, Unsupported
from gateway.protocols.base.driver import Schedule, Steps, Wait
from gateway.protocols.lx200.driver.drive import set_tracking, track_rate
from gateway.protocols.lx200.driver.ends import MOUNT, begins
from gateway.protocols.lx200.driver.identify import read_status
from gateway.protocols.lx200.driver.pointing import begin, still_seeking, stop_current_motion
from gateway.protocols.lx200.driver.state import Lx200Driver, ask

SETTLE, SEEK_EVERY = 0.5, 2.0


class SeekOn(op.Operation, frozen=True):
    """Internal: look whether home was found."""


def park(mount: Lx200Driver, _: op.Park) -> Steps:
    """:hP - the telescope switches its drives off when it is there."""
    yield from stop_current_motion(mount)
    yield from begin(mount, "hP", then="park")


def seek(mount: Lx200Driver, operation: op.Home | op.SetHome) -> Steps:
    """:hF, and :hS, by which the telescope stores where its switches are."""
    yield from stop_current_motion(mount)
    mount.seeking = True  # from here on nothing is asked; what waits for the line already is answered first
    yield Wait(SETTLE)
    begins(mount, *MOUNT)
    try:
        yield from ask(mount, "hS" if isinstance(operation, op.SetHome) else "hF")
    except Fault:
        mount.seeking = False
        raise
    mount.seeking = True
    yield Schedule(SEEK_EVERY, SeekOn())


def seek_on(mount: Lx200Driver, _: SeekOn) -> Steps:
    """Look again and again, for nobody else may be asking, and nothing else is asked until it has found it."""
    if not mount.seeking:
        return
    with contextlib.suppress(Busy, NoAnswer):
        if not (yield from still_seeking(mount)):
            return
    yield Schedule(SEEK_EVERY, SeekOn())


def home_state(mount: Lx200Driver, _: op.HomeState) -> Steps:
    """:h? -> 0 failed, 1 found, 2 searching."""
    return int((yield from ask(mount, "h?"))["state"])


def unpark(mount: Lx200Driver, _: op.Unpark) -> Steps:
    """A parked LX200GPS wakes by :I; the state is read anew, and tracking goes on where it can. Raises Unsupported."""
    if mount.parked and mount.supports("I"):
        with contextlib.suppress(NoAnswer):
            yield from ask(mount, "I")
        mount.powerless = False
        if mount.rate is not None:  # that was a new start, at its own rate
            yield from track_rate(mount, mount.rate)
    elif mount.parked and not mount.tells_status:
        raise Unsupported("This telescope comes back into service with the next goto.")
    mount.parked = False
    yield from read_status(mount)
    if mount.tells_status and mount.tracking is op.Tracking.OFF:
        yield from set_tracking(mount, op.SetTracking(on=True))


def sleep(mount: Lx200Driver, _: op.Hibernate) -> Steps:
    """:hN - from then on nothing is sent that would turn a motor: a telescope that sleeps says yes and stays."""
    yield from ask(mount, "hN")
    mount.powerless = True


def wake(mount: Lx200Driver, _: op.Wake) -> Steps:
    """:hW"""
    yield from ask(mount, "hW")
    mount.powerless = False
