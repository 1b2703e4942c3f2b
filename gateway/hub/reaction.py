"""How long it takes to see where the mount is and to stop it, on the line that there is.

Seconds, from what an exchange typically takes. What cannot be had sooner than that must be known before.
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
#: Exchanges from the end of one axis to the end of the other, which alone may lead where both together do not.
BETWEEN = 2.0


def interval(hub: Hub) -> float:
    """From one look to the next: where the mount moves, each read of a position is told twice."""
    return max(RENEW[op.Position], 2.0 * hub.driver.position_reads * hub.line.typical)


def to_stop(hub: Hub) -> float:
    """From where a position was true to the effect of the stop that it calls for."""
    return (EXCHANGES + hub.driver.position_reads - 1) * hub.line.typical


def reaction(hub: Hub) -> float:
    """From one look to the effect of the next."""
    return interval(hub) + to_stop(hub)


def overdue(hub: Hub, elapsed: float) -> float:
    """The same when the last two looks were so far apart: the next one may be as late."""
    return max(reaction(hub), elapsed + EXCHANGES * hub.line.typical)


def between(hub: Hub) -> float:
    """From the end of one of two axes to the end of the other; 0 where at most one moves."""
    return BETWEEN * hub.line.typical if len(hub.motions.axes) > 1 else 0.0
