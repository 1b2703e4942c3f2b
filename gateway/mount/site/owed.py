"""Settings that a program was told yes to and that the mount has not heard: of each kind at most one, the newest.

Frozen values and pure functions; times are seconds of any clock that never goes back. A setting is tried a few times
and no more: each new date freezes a classic telescope for seconds. It waits as long as it must for a mount that cannot
hear, and is over when the mount has a value that somebody else has given it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.operations import Moment, Operation, Place, SetClock, SetSite
from gateway.mount.site.site_clock import CLOCK_EQUAL, SITE_EQUAL

#: How often one is sent, and the seconds until the next time after the first, the second …
TRIES = 3
AGAIN = (2.0, 5.0)
#: How soon a mount that cannot hear now is looked at again, and one that has said so itself.
LOOK, BUSY = 0.5, 2.0
#: A clock that has heard of the new zone, time or date alone is off by so many seconds, or by a multiple of them.
ZONES = 1800.0

Kind = tuple[type[Operation], int | None]


class Setting(Struct, frozen=True):
    """A value, when it was asked for (a clock runs on from there), how often it is still sent, and not before when."""

    value: Operation
    since: float
    left: int = TRIES
    due: float = 0.0

    @property
    def late(self) -> bool:
        """Whether it could not be told at once: what the mount has meanwhile is asked for first."""
        return self.due > 0.0

    def running(self, now: float) -> Operation:
        """What is to be told now: a clock has gone on."""
        if isinstance(self.value, SetClock):
            return replace(self.value, unix=self.value.unix + now - self.since)
        return self.value


Owed = Mapping[Kind, Setting]


def kind_of(operation: Operation) -> Kind:
    """What a newer setting takes the place of: one of the same type, and of the same axis."""
    return type(operation), getattr(operation, "axis", None)


def owing(owed: Owed, setting: Setting) -> Owed:
    """The newest of a kind is the one that is told."""
    return {**owed, kind_of(setting.value): setting}


def without(owed: Owed, setting: Setting) -> Owed:
    """It is over; a newer one of its kind is not."""
    return {kind: one for kind, one in owed.items() if one is not setting}


def later(owed: Owed, setting: Setting, due: float) -> Owed:
    """It was not sent: the mount could not hear."""
    return {kind: replace(one, due=due) if one is setting else one for kind, one in owed.items()}


def in_vain(owed: Owed, setting: Setting, now: float) -> Owed:
    """It was sent, and nobody knows whether it was heard. After the last time it is owed no more."""
    if setting.left <= 1:
        return without(owed, setting)
    again = replace(setting, left=setting.left - 1, due=now + AGAIN[min(TRIES - setting.left, len(AGAIN) - 1)])
    return {kind: again if one is setting else one for kind, one in owed.items()}


def next_setting(owed: Owed, now: float) -> Setting | float | None:
    """The setting to be told now; else the time at which one is due; None when nothing is owed.

    The clock comes last: a classic is deaf for seconds afterwards.
    """
    due = [one for one in owed.values() if one.due <= now]
    if due:
        return min(due, key=lambda one: (isinstance(one.value, SetClock), one.since))
    return min((one.due for one in owed.values()), default=None)


def site_is_ours(sent: Sequence[Setting], before: Place | None, told: Place) -> bool:
    """Whether a site that the mount tells can come of what it was sent since: each half is as it was, or as we set it.

    It may have heard one half and not the other.
    """
    values = [one.value for one in sent if isinstance(one.value, SetSite)]
    latitudes = [value.latitude for value in values if value.latitude is not None]
    longitudes = [value.longitude for value in values if value.longitude is not None]
    if before is None or not values:
        return False
    return (
        min(abs(told.latitude - one) for one in (before.latitude, *latitudes)) <= SITE_EQUAL
        and min(abs(wrap180(told.longitude - one)) for one in (before.longitude, *longitudes)) <= SITE_EQUAL
    )


def clock_is_ours(sent: Sequence[Setting], before: Moment | None, told: Moment, now: float) -> bool:
    """The same for its clock: of zone, time and date it may have heard some and not others."""
    values = [value for one in sent if isinstance(value := one.running(now), SetClock)]
    if before is None or not values:
        return False
    times = (before.unix, *(value.unix for value in values))
    return min(abs((told.unix - unix + ZONES / 2) % ZONES - ZONES / 2) for unix in times) <= CLOCK_EQUAL
