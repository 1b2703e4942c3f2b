"""Whether a goto that is over has come to its goal; where it has not, that is told and left as it is.

Whoever stands beside the mount may have ended it there, and is not fought.
"""

from __future__ import annotations

from gateway.astro.spherical import separation
from gateway.core.operations import Equatorial

#: Degrees from the goal within which every mount ends a goto that nobody ends before.
CLOSE = 0.5


def missed(goal: Equatorial, here: Equatorial) -> str:
    """Words for the log; none where it has arrived. Both places in the same coordinates, degrees."""
    away = separation(goal.ra, goal.dec, here.ra, here.dec)
    return "" if away <= CLOSE else f"the goto ended {away:.1f} degrees from its goal: it was ended at the mount"
