"""Sleeping and waking: ``x`` and ``y`` where the firmware has them, else tracking off and on.

A hand control that wakes goes on tracking; some are late with that, so it is told to a little later, unless it was told
something else about tracking meanwhile.
"""

from __future__ import annotations

from gateway.core.errors import NoAnswer
from gateway.core.operations import Hibernate, Operation, SetTracking, Unpark, Wake
from gateway.protocols.base.driver import Schedule, Send, Steps
from gateway.protocols.nexstar.driver import tracking
from gateway.protocols.nexstar.driver.goto import unpark
from gateway.protocols.nexstar.driver.state import NexStar

#: Seconds from ``y`` until it is told to track.
AWAKE = 2.0


def sleep(mount: NexStar, _: Hibernate) -> Steps:
    """``x`` where the firmware has it, else tracking off."""
    if mount.knows("x"):
        try:
            yield Send("x")
        except NoAnswer:
            if not mount.asleep:  # else it sleeps already, and does not answer that either
                raise
        mount.asleep, mount.woken = True, False
        mount.at_rest()
        mount.suspended = None  # it wakes tracking
    else:
        yield from tracking.set_tracking(mount, SetTracking(on=False))


class Awake(Operation, frozen=True):
    """Internal: it was woken, and goes on tracking; not where it was told something else about that meanwhile."""

    survives_abort = True


def awake(mount: NexStar, _: Awake) -> Steps:
    """Some seconds after ``y``."""
    if mount.woken:
        mount.woken = False
        yield from unpark(mount, Unpark())


def wake(mount: NexStar, _: Wake) -> Steps:
    """``y`` where the firmware has it, else tracking on."""
    if mount.knows("y"):
        yield Send("y")
        mount.asleep, mount.woken = False, True
        yield Schedule(AWAKE, Awake())
    else:
        yield from tracking.set_tracking(mount, SetTracking(on=True))
