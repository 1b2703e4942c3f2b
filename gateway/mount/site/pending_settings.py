"""Pending settings: the newest of each kind that the gateway has accepted and the mount has not received yet.

Only `IncomingSettings` is not frozen; times are seconds of a monotonic clock. A setting is sent a few times at most,
because each new date makes a classic Meade unresponsive for seconds. It waits without limit for a mount that is not
reachable. It is dropped if the mount gets another value meanwhile, for example at its hand control.
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

#: How often a setting is sent at most, and the seconds to wait after the first attempt, the second …
TRIES = 3
RETRY_DELAYS = (2.0, 5.0)
#: Seconds until the next check of a mount that is not reachable, and of a mount that has replied that it is busy.
CHECK_DELAY, BUSY_DELAY = 0.5, 2.0
#: Seconds: if a clock took only part of the new zone, time and date, its error is a multiple of this.
TZ_STEP = 1800.0
#: Seconds after which a refused program should try again: usually, and while a classic Meade calculates its planets.
RETRY_HINT, CALCULATION_HINT = 2.0, 10.0
#: Seconds by which a setting may be sent later than its timer is set.
TIMER_SLACK = 0.5

Kind = tuple[type[Operation], int | None]


class Setting(Struct, frozen=True):
    """A value for the mount: the operation, when a program requested it, the attempts left, the earliest time of the
    next attempt (0: at once), and the host of the program.
    """

    value: Operation
    requested_at: float
    tries_left: int = TRIES
    due_at: float = 0.0
    client_name: str = ""

    @property
    def was_delayed(self) -> bool:
        """Whether the setting could not be sent at once. Then the mount's value is read before the setting is sent."""
        return self.due_at > 0.0

    def value_now(self, now: float) -> Operation:
        """Return the value to send now; a clock gets the time added that has passed since the request."""
        if isinstance(self.value, SetClock):
            return replace(self.value, unix=self.value.unix + now - self.requested_at)
        return self.value


Pending = Mapping[Kind, Setting]
#: The settings that are never sent to a moving mount.
AT_REST = (SetSite, SetClock)


def kind_of(operation: Operation) -> Kind:
    """Return the key by which a newer setting replaces an older setting: its type and its axis."""
    return type(operation), getattr(operation, "axis", None)


class IncomingSettings:
    """The settings that the gateway has accepted from programs and that the mount has not received. Gotos wait for the
    sites and clocks among them.

    ``type_being_sent``: the type SetSite or SetClock while such a setting is being sent. ``deadlines``: for each
    program that has sent only a part of its site or clock, the loop time until which the gateway expects the rest.
    """

    def __init__(self) -> None:
        self.pending: Pending = {}
        self.type_being_sent: type[Operation] | None = None
        self.deadlines: dict[ProgramId, float] = {}

    def expect_rest(self, program: ProgramId, expires_at: float) -> None:
        """Expect the other commands for a site or clock of this program until this loop time."""
        self.deadlines[program] = expires_at + TIMER_SLACK

    def note_complete(self, program: ProgramId) -> None:
        """Note that a program has sent all commands for its site or clock, or has run out of time."""
        self.deadlines.pop(program, None)

    def goto_refusal(self, now: float, calculating: bool = False) -> Busy | None:
        """Return the refusal of a goto that must wait for a site or clock; None if neither is pending or expected. Its
        text says how long to wait: longer if the mount is ``calculating`` its planets.
        """
        coming = [setting for (kind, _), setting in self.pending.items() if kind in AT_REST]
        self.deadlines = {program: until for program, until in self.deadlines.items() if until > now}
        if not (coming or self.deadlines):
            return None
        what = "site" if coming and all(isinstance(setting.value, SetSite) for setting in coming) else "clock"
        wait = max([RETRY_HINT, *(CALCULATION_HINT,) * calculating, *(end - now for end in self.deadlines.values()),
                    *(setting.due_at - now for setting in coming)])  # fmt: skip
        return Busy(f"The mount is taking a new {what}. Try again in {ceil(wait)} seconds.")


def add(pending: Pending, setting: Setting) -> Pending:
    """Return the pending settings with this one added; it replaces an older setting of its kind."""
    return {**pending, kind_of(setting.value): setting}


def without_setting(pending: Pending, setting: Setting) -> Pending:
    """Return the pending settings without this one; a newer setting of its kind stays."""
    return {kind: other for kind, other in pending.items() if other is not setting}


def with_postponed(pending: Pending, setting: Setting, due_at: float) -> Pending:
    """Return the pending settings with this one due later: the mount was busy or not reachable."""
    return {kind: replace(other, due_at=due_at) if other is setting else other for kind, other in pending.items()}


def after_attempt(pending: Pending, setting: Setting, now: float) -> Pending:
    """Return the pending settings after an attempt that the mount did not acknowledge: this one is due later, or
    dropped after the last attempt.
    """
    if setting.tries_left <= 1:
        return without_setting(pending, setting)
    wait = RETRY_DELAYS[min(TRIES - setting.tries_left, len(RETRY_DELAYS) - 1)]
    again = replace(setting, tries_left=setting.tries_left - 1, due_at=now + wait)
    return {kind: again if other is setting else other for kind, other in pending.items()}


def next_setting(pending: Pending, now: float) -> Setting | float | None:
    """Return the setting to be sent now, else the time at which the next one is due; None if there are none.
    The clock is sent last, because a classic telescope does not respond for seconds afterwards.
    """
    due = [setting for setting in pending.values() if setting.due_at <= now]
    if due:
        return min(due, key=lambda setting: (isinstance(setting.value, SetClock), setting.requested_at))
    return min((setting.due_at for setting in pending.values()), default=None)


def site_matches_sent(sent_settings: Sequence[Setting], previous: Place | None, reported: Place) -> bool:
    """Whether the site that the mount reports may come from the sites that the gateway has sent.
    Latitude and longitude may each be the old value or a sent value, because the mount may have received only one.
    """
    values = [setting.value for setting in sent_settings if isinstance(setting.value, SetSite)]
    latitudes = [value.latitude for value in values if value.latitude is not None]
    longitudes = [value.longitude for value in values if value.longitude is not None]
    if previous is None or not values:
        return False
    return (
        min(abs(reported.latitude - latitude) for latitude in (previous.latitude, *latitudes)) <= SITE_TOLERANCE
        and min(abs(wrap180(reported.longitude - longitude)) for longitude in (previous.longitude, *longitudes))
        <= SITE_TOLERANCE
    )


def clock_matches_sent(sent_settings: Sequence[Setting], previous: Moment | None, reported: Moment, now: float) -> bool:
    """Whether the clock that the mount reports may come from clocks that were sent, even if received in part."""
    values = [value for setting in sent_settings if isinstance(value := setting.value_now(now), SetClock)]
    if previous is None or not values:
        return False
    times = (previous.unix, *(value.unix for value in values))
    return min(abs((reported.unix - unix + TZ_STEP / 2) % TZ_STEP - TZ_STEP / 2) for unix in times) <= CLOCK_TOLERANCE
