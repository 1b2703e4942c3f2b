"""What every part of a mount may use, and how far the mount is known: nothing here knows any of the parts."""

from __future__ import annotations

import asyncio

from gateway.core.waiting import BackgroundTasks
from gateway.core.wire_log import WireLog
from gateway.mount.policy import Policy
from gateway.protocols.base.driver import Driver


class Milestones:
    """``met`` is set once a mount is known to be there, ``known`` once it has said who it is, ``settled`` once it has
    said where and when it is, too. Only ``Identification`` sets them.
    """

    def __init__(self) -> None:
        self.met, self.known, self.settled = asyncio.Event(), asyncio.Event(), asyncio.Event()

    def nothing_comes(self) -> None:
        """The gateway ends: whoever waits for the mount goes on, and finds the line closed."""
        self.met.set()
        self.known.set()


class Context:
    """The driver, the operator's policy, the log, the loop's clock, background tasks; and how far the mount is known.

    ``closed`` is set at the end: nothing is begun any more.
    """

    def __init__(self, driver: Driver, policy: Policy, log: WireLog) -> None:
        self.driver, self.policy, self.log = driver, policy, log
        self.now = asyncio.get_running_loop().time
        self.tasks = BackgroundTasks()
        self.milestones = Milestones()
        self.closed = False

    def note(self, text: str) -> None:
        """Leave a line about the mount in the log."""
        self.log.note("mount", text)

    def note_once(self, text: str) -> None:
        """The same, unless it was said before."""
        self.log.note_once("mount", text)
