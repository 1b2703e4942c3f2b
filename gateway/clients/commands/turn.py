"""A command on its way to its reply, and how long it may take."""

from __future__ import annotations

import asyncio

from gateway.core.operations import Operation
from gateway.protocols.base.ends import Ending
from gateway.protocols.base.wants import Handling

#: In the place of the count of stops: it was sent before all of them, and nobody may be there any more who sent it. It
#: begins no motion and holds none.
LONG_AGO = -1
#: Seconds after which a reply is not given any more: programs have gone on by then, and would take it for that of the
#: next (NexStar protocol: the hand control answers within 3.5 s). The mount is waited for a little less long, so that
#: what came together with a command which it does not answer is answered itself.
ANSWER_WITHIN, WAIT_FOR_MOUNT = 3.5, 3.4
#: A motion that is not begun so many seconds after it was asked for is refused, while that can still be said.
NO_IN_TIME = 3.0


class Turn:
    """One that came at this loop time, after so many stops.

    ``ending`` is what it has ended already, when it came. ``plain`` and ``spent`` say whether its reply may be
    repeated, ``halting`` that it has ended a motion last, ``baud`` the rate to go on with after its answer. It is
    ``late`` once nobody waits for its reply any more.
    """

    __slots__ = (
        "baud",
        "came",
        "ending",
        "frame",
        "halting",
        "lasting",
        "late",
        "plain",
        "spent",
        "steps",
        "stops",
        "timer",
    )

    def __init__(self, frame: bytes, stops: int, ending: Ending | None, came: float) -> None:
        self.frame, self.stops, self.ending, self.came = frame, stops, ending, came
        self.steps: Handling
        self.spent: list[type[Operation]] = []
        self.plain, self.halting, self.lasting, self.late = True, False, False, False
        self.baud: int | None = None
        self.timer: asyncio.TimerHandle | None = None
