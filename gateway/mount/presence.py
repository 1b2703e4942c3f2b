"""The client connections of each host, and when each was last active.

While a connection is open, only its own bytes show that the client is alive: another program on the same computer does
not hold the same arrow. After it is closed, connections that the same host has opened since count, too, because some
programs open a connection for every command.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

#: Seconds after which a closed connection is forgotten.
MEMORY_TIME = 60.0


class ProgramId(NamedTuple):
    """A program to which site and clock settings belong: a host on one surface (0: no surface, such as a command)."""

    host: str
    surface: int = 0


#: The gateway itself, and who embeds it.
NO_PROGRAM = ProgramId("")


class HostActivity:
    """A connection of the host ``client_name``. ``sent_data`` is set by any data from it, and reset by the supervisor.

    ``program`` stands for all connections of that host to one surface, which share their site and clock.
    """

    __slots__ = ("closed", "last_active_at", "opened", "program", "sent_data", "who")

    def __init__(self, client_name: str, opened: float, surface: int = 0) -> None:
        self.who, self.opened, self.program = client_name, opened, ProgramId(client_name, surface)
        self.sent_data = True
        self.last_active_at = opened
        self.closed: float | None = None


class Presence:
    """The connections of all hosts. ``clock`` is the event loop's clock."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._hosts: dict[str, list[HostActivity]] = {}
        self._swept = clock()

    def connected(self, host: str, surface: int = 0) -> HostActivity:
        now = self._clock()
        if now - self._swept > MEMORY_TIME:
            self._swept = now
            remaining = {
                who: [visit for visit in activities if visit.closed is None or now - visit.closed <= MEMORY_TIME]
                for who, activities in self._hosts.items()
            }
            self._hosts = {who: activities for who, activities in remaining.items() if activities}
        activity = HostActivity(host, now, surface)
        self._hosts.setdefault(host, []).append(activity)
        return activity

    def forget(self, activity: HostActivity) -> None:
        """Forget a connection that did not belong to a telescope program, as if it had never been opened."""
        self._hosts[activity.who].remove(activity)

    def disconnected(self, activity: HostActivity) -> None:
        activity.closed = self._clock()

    def returned(self, activity: HostActivity) -> None:
        """Note that a connection that seemed closed still has its client."""
        activity.closed = None

    def connections_for(self, activity: HostActivity) -> list[HostActivity]:
        """Return this connection, and if it is closed, also those that its host has opened since."""
        closed = activity.closed
        if closed is None:
            return [activity]
        return [activity, *(later for later in self._hosts.get(activity.who, ()) if later.opened >= closed)]
