"""The dead man's switch: fast motion by hand, and the focuser's, needs somebody at the other end.

Who began it must be heard of: while the connection that did so is open, its own bytes count and nobody else's, for
another program on the same computer does not hold that arrow. Once it is closed, connections count that the same host
has opened since: some programs open one for every command. Rates up to 60" a second are somebody's tracking and go on;
gotos end by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from msgspec import Struct

from gateway.core.operations import Operation

#: Up to so many degrees a second a motion by hand is somebody's own tracking.
TRACKING = 60.0 / 3600.0
#: How often it is looked after somebody, seconds.
EVERY = 0.5
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


class Supervised(Struct, frozen=True):
    """A motion that needs somebody: what ends it, whose it is, and since when."""

    ends: Operation
    by: HostActivity
    since: float


class Missing(Struct, frozen=True):
    """A motion whose program is not there any more, and why in words."""

    motion: Supervised
    why: str


class Presence:
    """Which hosts have connections. ``now`` is the event loop's clock."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._hosts: dict[str, list[HostActivity]] = {}
        self._swept = now()

    def arrive(self, host: str) -> HostActivity:
        """A connection from this host was opened."""
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
        """It was closed."""
        activity.closed = self._now()

    def stands_for(self, activity: HostActivity) -> list[HostActivity]:
        """The connections whose bytes count for it: itself, and once it is closed, those that its host opened since."""
        closed = activity.closed
        if closed is None:
            return [activity]
        return [activity, *(later for later in self._hosts.get(activity.who, ()) if later.opened >= closed)]


def missing(
    motions: Iterable[Supervised], presence: Presence, now: float, silence: float, closed: float
) -> list[Missing]:
    """The motions whose program is gone, or has been silent for too long.

    ``silence`` and ``closed`` are the seconds allowed on an open connection and after the last one was closed.
    """
    found = []
    for motion in motions:
        there = presence.stands_for(motion.by)
        for one in there:
            if one.heard:
                one.heard, one.last = False, now
        left = [one.closed for one in there if one.closed is not None]
        if len(left) == len(there) and now - max(motion.since, *left) >= closed:
            found.append(Missing(motion, "has disconnected"))
        elif now - max(motion.since, *(one.last for one in there)) >= silence:
            found.append(Missing(motion, f"has sent nothing for {silence:g} s"))
    return found
