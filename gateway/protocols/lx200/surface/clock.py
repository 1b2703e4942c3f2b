"""Local time, date and UTC offset.

A client sets the three in any order, even over several connections. They are collected in a draft and sent to the mount
as one instant when all three are set, after a pause, or before the clock is read. The UTC they define is preserved.
Meade's offset must be ADDED to local time to get UTC; the gateway's offsets are local time minus UTC.
"""

from __future__ import annotations

import contextlib
from copy import copy
from datetime import UTC, date, datetime, timedelta

from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NoDevice, ReadOnly, Unsupported
from gateway.protocols.base.wants import Defer, Handling, decoded
from gateway.protocols.lx200.nmea import format_rmc
from gateway.protocols.lx200.session import ClockDraft, LxSession
from gateway.protocols.wireformat.command import Command

#: Seconds without a further part after which an incomplete draft is sent.
DRAFT_PAUSE = 2.0
#: Parts set within so many seconds belong together: a new offset then keeps local time and date, as on a Meade.
SAME_SETTING_PERIOD = 60.0
#: A date can be read as local or as UTC: the reading nearer to the host's clock counts, if at most so many seconds off.
MAX_HOST_DIFFERENCE = 86400.0
_DATE_REPLY = "Updating        planetary data. "


def round_to_half_hour(offset: float) -> float:
    """Return the offset for a reply in whole or half hours: quarters, whose notation is ambiguous, are rounded down."""
    return round(offset * 2) / 2 if abs(offset * 2 - round(offset * 2)) < 1e-6 else (offset * 2 // 1) / 2


def _local_time(session: LxSession) -> Handling:
    """Return the client's local time now as a naive datetime, by the offset that :GG reports to this client."""
    yield from commit_draft_if_allowed(session)
    moment: op.Moment = yield op.GetClock()
    offset = round_to_half_hour(moment.offset if session.client.utc_offset is None else session.client.utc_offset)
    # Not rounded: whole seconds are cut off, as clocks do, although the reply is then half a second late on average.
    return datetime.fromtimestamp(moment.unix, UTC).replace(tzinfo=None) + timedelta(hours=offset)


def tell_local_time(session: LxSession) -> Handling:
    """:GL :Ga :GC - the local time in 24 or 12 hours, or the date."""
    local: datetime = yield from _local_time(session)
    return {"time": local.hour * 3600 + local.minute * 60 + local.second, "date": local.date()}


def tell_offset(session: LxSession) -> Handling:
    """:GG - the offset from UTC."""
    yield from commit_draft_if_allowed(session)
    offset = session.client.utc_offset
    if offset is None:
        moment: op.Moment = yield op.GetClock()
        offset = moment.offset
    return {"offset": -round_to_half_hour(offset)}


def contradicts_client(session: LxSession, command: str, values: op.Values) -> bool:
    """Whether the mount's own reply to :GG could contradict the offset that this client has set."""
    client = session.client
    return command == "GG" and (client.utc_offset is not None or client.clock_draft not in (None, ClockDraft()))


def commit_draft_if_allowed(session: LxSession) -> Handling:
    """Send the draft before the clock is read or a goto begins; a read-only client reads the clock unchanged."""
    with contextlib.suppress(ReadOnly):
        yield from commit_draft(session)


def _get_draft(session: LxSession) -> ClockDraft:
    """Return the draft, which the next connection of the same program continues."""
    if session.client.clock_draft is None:
        session.client.clock_draft = ClockDraft()
    return session.client.clock_draft


def set_clock_part(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:SL :SC :SG - set one of the three parts; the third part, or a pause, sends them to the mount."""
    values = decoded(values)
    session.check_write_access()
    draft = _get_draft(session)
    draft.changed_at = session.clock()
    if command.name == "SG":
        _keep_local_time(session, draft, -values["offset"])
        session.client.utc_offset = draft.offset = -values["offset"]
    elif command.name == "SL":
        draft.time = values["time"], session.clock()
        draft.carried_parts -= {"time"}
    else:
        draft.day = values["date"]
        session.client.date_set = values["date"], session.clock()
        draft.carried_parts -= {"day"}
    if draft.is_complete:
        yield from commit_draft(session)
    else:
        yield Defer(DRAFT_PAUSE, "clock.commit_draft_after_pause")
    if command.name != "SC":
        return None
    if session.model.get("own"):
        return {"text": session.model["date_text"], "blank": " " * session.model["date_blanks"]}
    return {"text": _DATE_REPLY, "blank": " " * 32}  # as wide as programs expect


def _keep_local_time(session: LxSession, draft: ClockDraft, offset: float) -> None:
    """If a local time was sent within a minute before this new offset, keep the local time, so that UTC changes.

    ``carried_parts`` names the parts that are kept, because the client may still send its own.
    """
    if session.client.local_time_sent is None or draft.time is not None:
        return
    day, seconds, at, with_offset = session.client.local_time_sent
    if offset != with_offset and session.clock() - at <= SAME_SETTING_PERIOD:
        draft.carried_parts = frozenset({"time"} if draft.day is not None else {"time", "day"})
        draft.time = (seconds, at)
        draft.day = draft.day or day


def commit_draft_after_pause(session: LxSession, command: Command | None, values: op.Values) -> Handling:
    """Send an incomplete draft after the pause, unless another part was set meanwhile."""
    if session.clock() - _get_draft(session).changed_at >= DRAFT_PAUSE - 0.1:
        yield from commit_draft(session)


def commit_draft(session: LxSession) -> Handling:
    """Send the draft to the mount: time and date as one instant; an offset alone only as this client's zone."""
    draft = _get_draft(session)
    pieces = copy(draft)
    draft.clear()
    if pieces.time is None and pieces.day is None:
        if pieces.offset is not None:
            yield op.SetZone(pieces.offset)
        return
    try:
        present: op.Moment = yield op.GetClock()
    except Fault:
        present = op.Moment(session.clock(), 0.0)
    # The deferred commit of an earlier connection may send this draft, so the draft's own offset comes first.
    offset = next((hours for hours in (pieces.offset, session.client.utc_offset) if hours is not None), present.offset)
    now = datetime.fromtimestamp(present.unix + offset * 3600.0, UTC)
    day = pieces.day or now.date()
    if pieces.time is not None:
        day = pieces.day or _recent_date(session) or day
        seconds, at = pieces.time
        elapsed = session.clock() - at
    else:
        seconds, elapsed = now.hour * 3600 + now.minute * 60 + now.second + now.microsecond / 1e6, 0.0
    if pieces.time is not None or session.client.local_time_sent is not None:
        session.client.local_time_sent = day, seconds, session.clock() - elapsed, offset
    local = pieces.set_by_one_command or not session.model.get("utc_date")
    yield op.SetClock(_unix_of_local(session, day, seconds, offset, local) + elapsed, offset)


def _recent_date(session: LxSession) -> date | None:
    """Return the date that this client set within the last minute: an offset set since does not change the day."""
    if session.client.date_set is None:
        return None
    day, at = session.client.date_set
    return day if session.clock() - at <= SAME_SETTING_PERIOD else None


def _unix_of_local(session: LxSession, day: date, seconds: float, offset: float, date_is_local: bool) -> float:
    """Return the Unix seconds of a local time. ``date_is_local``: the date is certainly local.

    By the manual an LX200GPS expects the UTC date, but some programs send the local date. The date that gives the
    instant nearer to the host's clock is used; the UTC date, if the host's clock is more than a day away from both.
    """
    midnight = datetime(day.year, day.month, day.day, tzinfo=UTC).timestamp()
    local = midnight + seconds - offset * 3600.0
    if date_is_local:
        return local
    universal = midnight + (seconds - offset * 3600.0) % 86400.0
    nearer = min(local, universal, key=lambda unix: abs(unix - session.clock()))
    return nearer if abs(nearer - session.clock()) <= MAX_HOST_DIFFERENCE else universal


def set_date_and_time(session: LxSession, values: op.Values) -> Handling:
    """:hIyyMMddHHmmss - set date and local time together."""
    session.check_write_access()
    try:
        local = datetime.strptime(values.get("stamp", ""), "%y%m%d%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        raise Invalid("The stamp is yyMMddHHmmss.") from None
    draft = _get_draft(session)
    draft.day, draft.set_by_one_command = local.date(), True
    draft.time = (local.hour * 3600 + local.minute * 60 + local.second, session.clock())
    yield from commit_draft(session)


def tell_sidereal(session: LxSession) -> Handling:
    """:GS - the apparent sidereal time at the mount's site by its clock."""
    yield from commit_draft_if_allowed(session)
    sidereal: float = yield op.SiderealTime()
    return {"sidereal": sidereal % 360.0}


def set_sidereal() -> None:
    """:SS - always raises Unsupported: sidereal time follows from clock and site."""
    raise Unsupported("The sidereal time follows from the mount's clock and site: :SL, :SC, :SG and :Sg set those.")


def toggle_hours(session: LxSession) -> None:
    """:H - toggle the 12-hour clock."""
    session.client.twelve_hour_clock = not session.client.twelve_hour_clock


def tell_hours(session: LxSession) -> dict[str, str]:
    """:Gc - 12 or 24 hours."""
    return {"hours": "12" if session.client.twelve_hour_clock else "24"}


# --- GPS: the mount's receiver; if it has none, the reply is that of a receiver without a fix ---


def gps_sentence() -> Handling:
    """:gps - one RMC sentence. Without a fix: status V, the mount's clock, and the mount's site if that is known."""
    try:
        receiver: op.Gps = yield op.GetGps()
    except (Unsupported, NoDevice):
        receiver = op.Gps(linked=False)
    place = receiver.place
    if place is None:
        with contextlib.suppress(Fault):
            place = yield op.GetSite()
    moment: op.Moment = yield op.GetClock()
    return {"text": format_rmc(place, receiver.unix or moment.unix, receiver.linked)}
