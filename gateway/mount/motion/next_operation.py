"""What is to be done next: the one function that decides it, for every mount.

Ends come first, then what was interrupted for one, then everything else in the order in which it was asked for. A guide
pulse waits for the one before it on its axis.
"""

from __future__ import annotations

from gateway.mount.motion.apply import pulses
from gateway.mount.motion.wanted import Order, Wanted


def next_operation(wanted: Wanted, now: float) -> Order | None:
    """The order that is due; None when there is none."""
    due = [order for order in wanted.pending if due_at(wanted, order) <= now]
    return min(due, key=lambda order: (order.rank, order.number), default=None)


def next_moment(wanted: Wanted) -> float | None:
    """The loop time at which the next order is due; None when nothing waits."""
    return min((due_at(wanted, order) for order in wanted.pending), default=None)


def due_at(wanted: Wanted, order: Order) -> float:
    """The loop time from which on an order may be carried out."""
    if order.follow_up or not wanted.pulses:
        return order.at
    axis = pulses(order)
    return max((order.at, *(one.until for one in wanted.pulses if one.axis == axis)))
