"""A goto that comes while a telescope calculates waits until it hears again: the newest one only, and not for long.

So does a tracking mode or rate, and, for as long as it takes, an end that is sent a second time. Arrows and pulses
never wait: by then they are no longer meant. A line that is down is waited for by nobody, and nobody's goto is begun
after its connection has closed. Pure functions.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.motion_kinds import GOTOS
from gateway.mount.motion.wanted import Order, Wanted

#: Seconds from the order on; and between two looks whether the mount hears again.
LONGEST, LOOK = 15.0, 0.1


def patient(order: Order) -> bool:
    """Whether it waits for a mount that cannot hear."""
    return order.heard or (isinstance(order.operation, (*GOTOS, op.SetTracking, op.TrackRate)) and not order.follow_up)


def may_wait(order: Order, now: float) -> bool:
    """Whether it has not waited for too long; whoever waits for its outcome is told no while he still listens."""
    return order.heard or now < min(order.since + LONGEST, order.until)


def forsaken(order: Order) -> bool:
    """Whether it is a goto whose program has gone."""
    return isinstance(order.operation, GOTOS) and order.by is not None and order.by.closed is not None


def postponed(wanted: Wanted, order: Order, now: float) -> Wanted:
    """It is due a little later."""
    pending = tuple(replace(one, at=now + LOOK) if one.number == order.number else one for one in wanted.pending)
    return replace(wanted, pending=pending, active=0 if wanted.active == order.number else wanted.active)
