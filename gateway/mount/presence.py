"""Who is there: the connections of every host, and when something was heard of them.

While a connection is open, its own bytes count and nobody else's, for another program on the same computer does not
hold its arrow. Once it is closed, connections count that the same host has opened since: some programs open one for
every command.
"""

from __future__ import annotations

from collections.abc import Callable

#: A connection that was closed so long ago is forgotten.
FORGET = 60.0


class HostActivity:
    """A connection of the host ``who``. ``heard`` is set by whatever it sends, and taken back when that was noticed."""

    __slots__ = ("closed", "heard", "last", "opened", "who")

    def __init__(self, who: str, opened: float) -> None:
        self.who, self.opened = who, opened
        self.heard = True
        self.last = opened
        self.closed: float | None = None


class Presence:
    """Which hosts have connections. ``now`` is the event loop's clock."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._hosts: dict[str, list[HostActivity]] = {}
        self._swept = now()

    def arrive(self, host: str) -> HostActivity:
        now = self._now()
        if now - self._swept > FORGET:
            self._swept = now
            kept = {
                who: [one for one in there if one.closed is None or now - one.closed <= FORGET]
                for who, there in self._hosts.items()
            }
            self._hosts = {who: there for who, there in kept.items() if there}
        activity = HostActivity(host, now)
        self._hosts.setdefault(host, []).append(activity)
        return activity

    def was_nobody(self, activity: HostActivity) -> None:
        """It has turned out to be a stranger's, and counts as if it had never been opened."""
        self._hosts[activity.who].remove(activity)

    def leave(self, activity: HostActivity) -> None:
        activity.closed = self._now()

    def stands_for(self, activity: HostActivity) -> list[HostActivity]:
        """The connections whose bytes count for it: itself, and once it is closed, those that its host opened since."""
        closed = activity.closed
        if closed is None:
            return [activity]
        return [activity, *(later for later in self._hosts.get(activity.who, ()) if later.opened >= closed)]
