"""Parking within the limits: where the owner has chosen the place it may lie beyond them, else it may not.

A Meade parks where it was told at its keypad, which nobody can ask it for; its own default is the horizon. So it parks
by itself where the limits are no narrower than the horizon, or where the owner allows it with park = "mount".
"""

from __future__ import annotations

from gateway.core.errors import Refused
from gateway.core.operations import Home, Park
from gateway.mount.safety.limits import Limits

CHOOSE = "Write park = [AZ, ALT] under [mount] for a place of your own choice, which may lie beyond lowest and highest."


def check_own_park(operation: Park | Home, limits: Limits) -> None:
    """A place that only the mount itself knows. Raises Refused."""
    if isinstance(operation, Park) and (limits.lowest > 0.0 or limits.highest < 90.0):
        raise Refused(
            "Where this mount parks is known to itself alone, and may lie beyond lowest or highest. "
            'Write park = "mount" under [mount] to allow it, or send it to a place that you choose.'
        )
