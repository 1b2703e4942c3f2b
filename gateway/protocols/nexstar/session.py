"""One client of the NexStar surface: what it has set for itself, and how what it orders is acknowledged.

The acknowledgement of an order does not wait for the mount. While the mount's line is down a pass-through command gets
the no-response form, everything else silence: a ``#`` would be a yes. What ends a motion is always acknowledged, for it
is owed to the mount until that has heard it.
"""

from __future__ import annotations

from collections.abc import Mapping

from gateway.core.errors import Asleep, Fault, NoAnswer
from gateway.core.operations import Operation
from gateway.protocols.base.session import Kept, Session
from gateway.protocols.base.wants import FireAndForget, Handling, Possible


class NexStarKept(Kept):
    """``axis_goto`` is where this client has sent single axes (1, 2) since its last goto, degrees."""

    axis_goto: Mapping[int, float] = {}


class NexStarSession(Session):
    state = NexStarKept
    kept: NexStarKept


def begin(operation: Operation) -> Handling:
    """Have it carried out, unless it is known already that it cannot be. Raises Fault then."""
    yield Possible(operation)
    yield FireAndForget(operation)


def attempt(operation: Operation) -> Handling:
    """Have it carried out; what cannot be done shows in the log alone. Raises NoAnswer where nobody can tell."""
    try:
        yield operation
    except Fault as fault:
        if isinstance(fault, NoAnswer) and not isinstance(fault, Asleep):
            raise
