"""The hold: while it is on, nothing moves the mount or switches its tracking on.

What ends a motion or tracking goes on, and so does what moves nothing: reads, settings, syncs, the rate at which a
drive that is on follows the sky, and the focuser, which hangs on the mount and does not turn it.
"""

from __future__ import annotations

from gateway.core import operations as op
from gateway.core.errors import Held

#: Of all that takes its turn among the motions this alone; whatever is new is refused until it is written here.
STILL = (op.AbortSlew, op.Choose, op.Focus, op.StopAxis, op.Hibernate, op.Sync, op.TrackRate)


class Hold:
    """``on`` is set and taken back from outside (``mount-gateway stop --hold``)."""

    def __init__(self) -> None:
        self.on = False

    def admit(self, operation: op.Operation) -> None:
        """Asked for everything that takes its turn among the motions. Raises Held."""
        stays = isinstance(operation, STILL) or (isinstance(operation, op.SetTracking) and not operation.on)
        if self.on and not stays:
            raise Held
