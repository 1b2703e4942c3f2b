"""How long it takes to see where the mount is and to bring it to rest, on the line that there is.

Seconds, from what an exchange typically takes and what motors need. What cannot be had sooner must be known before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gateway import operations as op
from gateway.hub.snapshot import RENEW

if TYPE_CHECKING:
    from gateway.hub.core import Hub

#: Looks that follow each other faster than that say nothing about a rate.
SHORTEST = 0.15
#: Exchanges that pass before a stop has effect: the one that told the position, one on the wire, the first of the stop.
EXCHANGES = 3
#: Motors do not stop at once: one that slows down evenly for a second runs on as far as in half a second at its speed.
#: No mount tells how it slows down; about a second from full speed is what owners see, and slower motors need less.
RUN_ON = 0.5
#: Exchanges from the end of one axis to the end of the other, which alone may lead where both together do not.
BETWEEN = 2.0


def interval(hub: Hub) -> float:
    """From one look to the next: where the mount moves, each read of a position is told twice."""
    return max(RENEW[op.Position], 2.0 * hub.driver.position_reads * hub.line.typical)


def to_stop(hub: Hub) -> float:
    """From where a position was true to where the stop that it calls for brings it to rest."""
    return (EXCHANGES + hub.driver.position_reads - 1) * hub.line.typical + RUN_ON


def reaction(hub: Hub) -> float:
    """From one look to the rest that the next one brings."""
    return interval(hub) + to_stop(hub)


def overdue(hub: Hub, elapsed: float) -> float:
    """The same when the last two looks were so far apart: the next one may be as late."""
    return max(reaction(hub), elapsed + EXCHANGES * hub.line.typical + RUN_ON)


def between(hub: Hub) -> float:
    """From the end of one of two axes to the end of the other; 0 where at most one moves."""
    return BETWEEN * hub.line.typical if len(hub.motions.axes) > 1 else 0.0

