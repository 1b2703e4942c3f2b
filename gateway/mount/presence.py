"""The client connections of each host, and when each was last active.

The supervisor stops a manual motion when its client falls silent. While the client's connection is open, only data on
this connection counts as a sign of life, because the host may run other programs. Once it is closed, data on newer
connections of the same host counts as well, because some programs open a connection for every command.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

#: Seconds after which a closed connection is forgotten.
FORGET_AFTER = 60.0


class ProgramId(NamedTuple):
    """The owner of site and clock settings: a host and the number of the surface that it uses (0: none)."""

    host: str
    surface_number: int = 0


#: Stands for the gateway itself, and for a Python program that embeds it.
NO_PROGRAM = ProgramId("")


class HostActivity:
    """The activity on one connection: the client's host (``client_name``), and the loop times at which it was opened,
    last active and closed. Any data from the client sets ``sent_data``, and the supervisor resets it.

    ``program`` is equal for all connections of a host to one surface: they share their site and clock settings.
    """

    __slots__ = ("closed_at", "host", "last_active_at", "opened_at", "program", "sent_data")

    def __init__(self, client_name: str, opened_at: float, surface_number: int = 0) -> None:
        self.host, self.opened_at, self.program = client_name, opened_at, ProgramId(client_name, surface_number)
        self.sent_data = True
        self.last_active_at = opened_at
        self.closed_at: float | None = None


class ClientPresence:
    """The connections of all client hosts. ``clock`` returns the event loop's time."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._by_host: dict[str, list[HostActivity]] = {}
        self._last_sweep_at = clock()

    def add_connection(self, host: str, surface_number: int = 0) -> HostActivity:
        now = self._clock()
        if now - self._last_sweep_at > FORGET_AFTER:
            self._last_sweep_at = now
            remaining = {
                who: [visit for visit in activities if visit.closed_at is None or now - visit.closed_at <= FORGET_AFTER]
                for who, activities in self._by_host.items()
            }
            self._by_host = {who: activities for who, activities in remaining.items() if activities}
        activity = HostActivity(host, now, surface_number)
        self._by_host.setdefault(host, []).append(activity)
        return activity

    def forget(self, activity: HostActivity) -> None:
        """Forget a connection that did not belong to a telescope program, as if it had never been opened."""
        self._by_host[activity.host].remove(activity)

    def mark_closed(self, activity: HostActivity) -> None:
        activity.closed_at = self._clock()

    def mark_open_again(self, activity: HostActivity) -> None:
        """Mark a connection as open again that counted as closed because its data arrived late."""
        activity.closed_at = None

    def connections_for(self, activity: HostActivity) -> list[HostActivity]:
        """Return this connection; if it is closed, also the connections that its host has opened since."""
        closed = activity.closed_at
        if closed is None:
            return [activity]
        return [activity, *(later for later in self._by_host.get(activity.host, ()) if later.opened_at >= closed)]
