"""Pending settings: the newest of each kind that the gateway has accepted and the mount has not received yet.

Frozen values and pure functions; times are seconds of a clock that never goes back. A setting is sent a few times at
most, because each new date makes a classic telescope unresponsive for seconds. It waits without limit for a mount that
is not reachable, and is dropped if the mount was given another value meanwhile, at its hand control for example.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

from msgspec import Struct
from msgspec.structs import replace

from gateway.astro.spherical import wrap180
from gateway.core.errors import Busy
from gateway.core.operations import Moment, Operation, Place, SetClock, SetSite
from gateway.mount.presence import ProgramId
from gateway.mount.site.site_clock import CLOCK_TOLERANCE, SITE_TOLERANCE

#: How often a setting is sent, and the seconds after the first attempt, the second …
TRIES = 3
RETRY_DELAYS = (2.0, 5.0)
#: Seconds until the next check of a mount that is not reachable, and of a mount that has replied that it is busy.
CHECK_DELAY, BUSY_DELAY = 0.5, 2.0
#: Seconds; a clock that has taken only the new zone, time or date is off by this or by a multiple of it.
ZONES = 1800.0
#: Seconds after which a program that was refused should ask again: usually, and while a classic calculates its planets.
RETRY_HINT, CALCULATION_HINT = 2.0, 10.0
#: Seconds by which a setting may be sent later than its timer says.
TIMER_SLACK = 0.5

Kind = tuple[type[Operation], int | None]


class Setting(Struct, frozen=True):
    """A value, when it was requested (a clock runs on from then), the attempts left, the time of the next attempt, and
    the host of the program.
    """

    value: Operation
    since: float
    tries_left: int = TRIES
    due_at: float = 0.0
    client_name: str = ""

    @property
    def late(self) -> bool:
        """Whether it could not be sent at once. Then the mount's present value is read before the setting is sent."""
        return self.due_at > 0.0

    def value_now(self, now: float) -> Operation:
        """Return the value to be sent now; a clock has run on since it was requested."""
        if isinstance(self.value, SetClock):
            return replace(self.value, unix=self.value.unix + now - self.since)
        return self.value


Pending = Mapping[Kind, Setting]
#: The settings that a mount in motion must not be sent.
SKY = (SetSite, SetClock)


def kind_of(operation: Operation) -> Kind:
    """Return the key by which a newer setting replaces an older setting: its type and its axis."""
    return type(operation), getattr(operation, "axis", None)


class IncomingSettings:
    """The settings that were accepted from programs and that the mount has not received. Gotos wait for sites and
    clocks among them.

    Only ``SyncSettings`` changes it. ``sending``: SetSite or SetClock while it is being sent. ``unfinished``: the
    programs that are still setting a site or clock, in several commands, each with the loop time until which the rest
    is expected.
    """

    def __init__(self) -> None:
        self.pending: Pending = {}
        self.sending: type[Operation] | None = None
        self.unfinished: dict[ProgramId, float] = {}

    def expect(self, program: ProgramId, expires_at: float) -> None:
        """Expect the rest of a site or clock of this program until this loop time, when it is sent without the rest."""
        self.unfinished[program] = expires_at + TIMER_SLACK

    def complete(self, program: ProgramId) -> None:
        """Note that a program has set all parts."""
        self.unfinished.pop(program, None)

    def holds_up(self, now: float, calculating: bool = False) -> Busy | None:
        """Return the refusal of a goto that could not wait any longer; None if it need not wait."""
        coming = [setting for (kind, _), setting in self.pending.items() if kind in SKY]
        self.unfinished = {program: until for program, until in self.unfinished.items() if until > now}
        if not (coming or self.unfinished):
            return None
        what = "site" if coming and all(isinstance(setting.value, SetSite) for setting in coming) else "clock"
        wait = max([RETRY_HINT, *(CALCULATION_HINT,) * calculating, *(end - now for end in self.unfinished.values()),
                    *(setting.due_at - now for setting in coming)])  # fmt: skip
        return Busy(f"The mount is taking a new {what}. Try again in {ceil(wait)} seconds.")


def added(pending: Pending, setting: Setting) -> Pending:
    """Add a setting. It replaces an older setting of its kind."""
    return {**pending, kind_of(setting.value): setting}


def without(pending: Pending, setting: Setting) -> Pending:
    """Remove a setting, unless a newer setting has replaced it."""
    return {kind: other for kind, other in pending.items() if other is not setting}


def postponed(pending: Pending, setting: Setting, due: float) -> Pending:
    """Postpone a setting that was not sent because the mount was busy or not reachable."""
    return {kind: replace(other, due_at=due) if other is setting else other for kind, other in pending.items()}


def tried(pending: Pending, setting: Setting, now: float) -> Pending:
    """Count an attempt after which it is unknown whether the mount received the setting; drop it after the last
    attempt.
    """
    if setting.tries_left <= 1:
        return without(pending, setting)
    wait = RETRY_DELAYS[min(TRIES - setting.tries_left, len(RETRY_DELAYS) - 1)]
    again = replace(setting, tries_left=setting.tries_left - 1, due_at=now + wait)
    return {kind: again if other is setting else other for kind, other in pending.items()}


def next_setting(pending: Pending, now: float) -> Setting | float | None:
    """Return the setting to be sent now, else the time at which the next one is due; None if there are none.

    The clock is sent last, because a classic telescope does not respond for seconds afterwards.
    """
    due = [setting for setting in pending.values() if setting.due_at <= now]
    if due:
        return min(due, key=lambda setting: (isinstance(setting.value, SetClock), setting.since))
    return min((setting.due_at for setting in pending.values()), default=None)


def site_is_ours(sent_settings: Sequence[Setting], before: Place | None, reported: Place) -> bool:
    """Whether the site that the mount reports may result from the site that the gateway sent.

    Each half is as it was before or as the gateway sent it, because the mount may have received only one half.
    """
    values = [setting.value for setting in sent_settings if isinstance(setting.value, SetSite)]
    latitudes = [value.latitude for value in values if value.latitude is not None]
    longitudes = [value.longitude for value in values if value.longitude is not None]
    if before is None or not values:
        return False
    return (
        min(abs(reported.latitude - latitude) for latitude in (before.latitude, *latitudes)) <= SITE_TOLERANCE
        and min(abs(wrap180(reported.longitude - longitude)) for longitude in (before.longitude, *longitudes))
        <= SITE_TOLERANCE
    )


def clock_is_ours(sent_settings: Sequence[Setting], before: Moment | None, reported: Moment, now: float) -> bool:
    """Like ``site_is_ours``, for the clock: the mount may have received zone, time and date only in part."""
    values = [value for setting in sent_settings if isinstance(value := setting.value_now(now), SetClock)]
    if before is None or not values:
        return False
    times = (before.unix, *(value.unix for value in values))
    return min(abs((reported.unix - unix + ZONES / 2) % ZONES - ZONES / 2) for unix in times) <= CLOCK_TOLERANCE
