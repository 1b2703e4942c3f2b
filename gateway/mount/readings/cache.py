"""The only cache of the mount's answers, with the time of each answer, and when a client last asked for it.

An answer is checked when it is requested: by its age, and by the loop time of its request, because positions from
before the last motion order are outdated for clients. Replies in the mount's own bytes are shared only until the next
order or setting (``order_count`` counts them).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from math import inf, isinf
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from msgspec import Struct

from gateway.core import operations as op
from gateway.core.errors import Fault
from gateway.core.signals import Signal
from gateway.core.waiting import TimedEvent

# `status` and `stop` load this module through the marker of a motion, and need neither line nor driver
if TYPE_CHECKING:
    from gateway.mount.link.line import MountLink
    from gateway.protocols.base.driver import Driver

_T = TypeVar("_T")
Kind = type[op.Operation]
Pair = tuple[float, float]

#: Returned for a reading that is not cached or no longer fresh: it must be requested from the mount.
NOT_CACHED: Any = object()

#: The age in seconds up to which a reading is fresh.
MAX_AGE: dict[Kind, float] = {
    op.Position: 0.5, op.HorizontalPosition: 0.5, op.AxisPosition: 0.5, op.Slewing: 1.0, op.GetStatus: 6.0,
    op.GetIdentity: 1e9, op.PierSide: 5.0,
}  # fmt: skip
#: The age in seconds up to which a reply in the mount's own protocol is fresh, by ``keep`` of its `op.NativeRequest`.
NATIVE_AGE = {"fixed": inf, "state": 1.0, "site": 1.0}
#: The largest number of cached replies in the mount's own protocol: clients may ask for any number of devices.
MAX_NATIVE_REPLIES = 200
#: The seconds between two reads of a kind while clients poll it.
POLL_PERIOD: dict[Kind, float] = {
    op.Position: 0.4, op.HorizontalPosition: 0.45, op.AxisPosition: 0.45, op.Slewing: 0.5, op.GetStatus: 2.5,
}  # fmt: skip
#: From a kind of reading to the kinds whose next poll is scheduled again when such a reading arrives.
POLLS_RESCHEDULED_BY: dict[Kind, tuple[Kind, ...]] = {
    **{kind: (kind,) for kind in POLL_PERIOD},
    op.Slewing: (op.Slewing, op.Position),
    op.Position: (op.Position, op.AxisPosition),
}
#: A reading counts as polled if a client asked for it within this many seconds.
POLLING_INTEREST_TIME = 3.0
#: A reading is fresh for at least this many times the mount's typical reply time.
FRESH_FACTOR = 2.5
#: The age in seconds up to which clients get the last position if the line is down or the mount does not reply.
MAX_STALE_AGE = 10.0


class Reading(Struct, frozen=True):
    """Two angles that the mount reported (a position or two axis readings), degrees, and the loop time of each."""

    angles: Pair
    times: Pair

    @property
    def completed_at(self) -> float:
        """The later of the two times: from then on both angles are known."""
        return max(self.times)


def angles_of(value: op.Equatorial | op.Horizontal) -> Pair:
    """Return the two angles of a position: azimuth and altitude, or right ascension and declination."""
    return (value.az, value.alt) if isinstance(value, op.Horizontal) else (value.ra, value.dec)


class CachedAnswer(Struct):
    """An answer of the mount (or the Fault instead), the loop time at which it arrived, and for how many seconds it is
    fresh.

    ``asked_at``: loop time of the request. ``order_count``: number of orders and settings sent before it. A position
    also has its ``reading``, the entry before it (``prev``) and, once calculated, its extrapolation
    (``extrapolation``). ``from_kind``: the kind from which it was calculated. A ``forgotten`` answer is outdated:
    it is used only if there is no newer one.
    """

    value: Any
    arrived_at: float = 0.0
    fresh_for: float = 0.0
    asked_at: float = 0.0
    order_count: int = 0
    reading: Reading | None = None
    prev: CachedAnswer | None = None
    extrapolation: Any = None
    from_kind: Kind | None = None
    forgotten: bool = False


class ReadingsCache:
    """The last answer to each kind of read, and the replies in the mount's own protocol by request."""

    def __init__(self, link: MountLink) -> None:
        self._link = link
        self.entries: dict[Kind, CachedAnswer] = {}
        self._native_replies: dict[op.NativeRequest, CachedAnswer] = {}
        self._last_polled_at: dict[Kind, float] = {}
        #: ``version`` grows whenever an answer may have changed; ``order_count`` counts the orders and settings sent.
        self.version = self.order_count = 0
        #: Positions that were requested before this loop time are outdated for clients.
        self.outdated_before = -1e9
        #: Emitted whenever the answer to Slewing may have changed, with that answer (False if there is none).
        self.slewing_changed: Signal[bool] = Signal()
        #: By kind of read: set when its next read may be due earlier than planned, which wakes the poller.
        self.due_events: defaultdict[Kind, TimedEvent] = defaultdict(TimedEvent)

    def put(self, kind: Kind, value: Any, now: float) -> None:
        """Store a value that the mount reported, or that follows from a command that it acknowledged."""
        self.store(kind, CachedAnswer(value), now)

    def store(self, kind: Kind, entry: CachedAnswer, now: float) -> None:
        """Store an answer that has just arrived."""
        entry.arrived_at, entry.fresh_for = now, MAX_AGE.get(kind, 0.0)
        self.entries[kind] = entry
        self.mark_changed(kind)

    def correct_value(self, kind: Kind, value: Any) -> None:
        """Replace the last answer by the value that an order has caused; this does not delay the next read."""
        self.entries[kind].value = value
        self.mark_changed(kind)

    def forget(self, *kinds: Kind) -> None:
        """Mark the last answers of these kinds as forgotten, because they are no longer true."""
        for kind in kinds:
            if kind in self.entries:
                self.entries[kind].forgotten = True
            self.mark_changed(kind)

    def clear(self) -> None:
        """Forget everything: after a reconnect it may be another mount."""
        self.forget(*self.entries)
        self._native_replies.clear()

    def mark_changed(self, kind: Kind) -> None:
        """Note that the answer may have changed: replies to clients are outdated, and the poller reads again soon."""
        self.version += 1
        for woken in POLLS_RESCHEDULED_BY.get(kind, ()):
            self.due_events[woken].set()
        if kind is op.Slewing:
            self.slewing_changed.emit(bool(self.last_value(kind)))

    def mark_outdated(self, now: float) -> None:
        """Treat positions that were requested before ``now`` as outdated for clients."""
        self.outdated_before = now
        self.version += 1

    def note_polled(self, kinds: Iterable[Kind], now: float) -> None:
        for kind in kinds:
            self._last_polled_at[kind] = now

    def last_value(self, kind: Kind) -> Any:
        """Return the last answer, however old; None if there is none or it is forgotten."""
        entry = self.entries.get(kind)
        return None if entry is None or entry.forgotten else entry.value

    def fresh_answer(self, kind: Kind, now: float) -> Any:
        """Return the answer for a client if it is fresh, else NOT_CACHED, and note that a client polls this kind.
        Answers stay fresh for longer while the line is slow or not up.
        """
        self._last_polled_at[kind] = now
        entry = self.entries.get(kind)
        if entry is None or entry.forgotten:
            return NOT_CACHED
        age, link = now - entry.arrived_at, self._link
        if age <= min(entry.fresh_for, MAX_STALE_AGE):  # whatever the line
            return entry.value
        fresh_for = max(entry.fresh_for, FRESH_FACTOR * link.times.typical_rtt) if link.state == "up" else MAX_STALE_AGE
        return entry.value if age <= fresh_for else NOT_CACHED

    def last_or_forgotten(self, kind: Kind) -> Any:
        """Return the last answer, even if it is forgotten; None before the first."""
        entry = self.entries.get(kind)
        return None if entry is None else entry.value

    def fresh_until(self, kinds: list[Kind]) -> float:
        """Return the loop time until which the readings of all these kinds are fresh; 0 if one is missing."""
        entries = [self.entries.get(kind) for kind in kinds]
        return min(0.0 if entry is None or entry.forgotten else entry.arrived_at + entry.fresh_for for entry in entries)

    def age(self, kind: Kind, now: float) -> float:
        """Return the seconds since the last answer; 1e9 if there is none or it is forgotten."""
        entry = self.entries.get(kind)
        return 1e9 if entry is None or entry.forgotten else now - entry.arrived_at

    def is_polled(self, kind: Kind, now: float) -> bool:
        return now - self._last_polled_at.get(kind, -1e9) <= POLLING_INTEREST_TIME

    # --- replies in the mount's own protocol -------------------------------------------------------------------------

    def native_reply(self, operation: op.NativeRequest, now: float) -> Any:
        """Return the mount's reply to a request, or the Fault that came instead, if fresh, else NOT_CACHED."""
        entry = self._native_replies.get(operation)
        if entry is None or now - entry.arrived_at >= entry.fresh_for:
            return NOT_CACHED
        return entry.value if entry.order_count == self.order_count or isinf(entry.fresh_for) else NOT_CACHED

    def store_native_reply(
        self, operation: op.NativeRequest, answer: bytes | Fault, fresh_for: float, order_count: int, now: float
    ) -> None:
        """Store the reply to a request sent after ``order_count`` orders. If the cache is full, drop the oldest."""
        self._native_replies.pop(operation, None)
        if fresh_for:
            self._native_replies[operation] = CachedAnswer(answer, now, fresh_for, order_count=order_count)
        if len(self._native_replies) > MAX_NATIVE_REPLIES:
            del self._native_replies[next(iter(self._native_replies))]


class NotRead(Exception):
    """The cache has no reading of this kind: the mount has not reported it yet, or the reading is forgotten."""


class ReadingSource(Protocol):
    """How the safety rules read the mount: from the ``Reader``, or from ``LastReadings`` for a preview."""

    async def read(self, operation: op.Operation[_T]) -> _T: ...
    async def read_now(self, operation: op.Operation[_T]) -> _T: ...
    async def tube_side(self) -> str | None: ...


class LastReadings:
    """The last readings, however old: the safety rules use them to preview an order that no client has sent yet.
    A preview sends nothing to the mount: ``read`` returns only stored values, and raises ``NotRead`` if there is none.
    """

    def __init__(self, cache: ReadingsCache, driver: Driver) -> None:
        self._cache, self._driver = cache, driver

    async def read(self, operation: op.Operation[_T]) -> _T:
        """Return the last reading. Raises NotRead."""
        value = self._cache.last_value(type(operation))
        if value is None:
            raise NotRead
        return cast(_T, value)

    read_now = read

    async def tube_side(self) -> str | None:
        """Return the pier side (E, W) of the tube of a German mount; None for other mounts. Raises NotRead."""
        return None if self._driver.tube_side("E") is None else self._driver.tube_side(await self.read(op.PierSide()))
