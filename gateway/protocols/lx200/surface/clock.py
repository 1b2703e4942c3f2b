"""Local time, date and UTC offset.

A client sets the three in any order, even over several connections; they are handed on as one instant, once all three
are there, when a moment has passed, or before the clock is needed. What is preserved is UTC. Meade's offset is what
must be ADDED to local time to get UTC; inside, offsets are local minus UTC.
"""

from __future__ import annotations

import calendar
import contextlib
from copy import copy
from datetime import UTC, date, datetime, timedelta

from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NoDevice, ReadOnly, Unsupported
from gateway.protocols.base.wants import Defer, Handling, given
from gateway.protocols.lx200.nmea import rmc
from gateway.protocols.lx200.session import Draft, LxSession
from gateway.protocols.wireformat.command import Command

#: One pause after the last piece, then what is there is taken.
QUIET = 2.0
#: What comes this long after another piece still belongs to it: local time and date stay, as on a Meade.
BELONGS = 60.0
#: A host's clock that is this far from either reading of a date cannot tell which one is meant.
HOST_KNOWS = 86400.0
_TEXT = "Updating        planetary data. "


def printable(offset: float) -> float:
    """The offset that is told: whole and half hours as they are; a quarter would be read in two ways, so its half."""
    return round(offset * 2) / 2 if abs(offset * 2 - round(offset * 2)) < 1e-6 else (offset * 2 // 1) / 2


def _local(session: LxSession) -> Handling:
    """The client's local time now, as a naive datetime, with the offset it will be told."""
    yield from _commit_if_allowed(session)
    moment: op.Moment = yield op.GetClock()
    offset = printable(moment.offset if session.kept.offset is None else session.kept.offset)
    # Half a second is what a whole-second reply is off by on average; none is invented here: cut, as clocks do.
    return datetime.fromtimestamp(moment.unix, UTC).replace(tzinfo=None) + timedelta(hours=offset)


def tell_local(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:GL in 24 hours, :Ga in 12, :GC the date."""
    local: datetime = yield from _local(session)
    return {"time": local.hour * 3600 + local.minute * 60 + local.second, "date": local.date()}


def tell_offset(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:GG"""
    yield from _commit_if_allowed(session)
    offset = session.kept.offset
    if offset is None:
        moment: op.Moment = yield op.GetClock()
        offset = moment.offset
    return {"offset": -printable(offset)}


def stands_against(session: LxSession, name: str, values: op.Values) -> bool:
    """Whether this client has set an offset, which the mount's own answer would contradict."""
    kept = session.kept
    return name == "GG" and (kept.offset is not None or kept.draft not in (None, Draft()))


def _commit_if_allowed(session: LxSession) -> Handling:
    """Before the clock is told: whoever may not set it is told it as it is."""
    with contextlib.suppress(ReadOnly):
        yield from commit(session)


def _draft(session: LxSession) -> Draft:
    """The one that this client shares with the next connection of the same program."""
    if session.kept.draft is None:
        session.kept.draft = Draft()
    return session.kept.draft


def set_piece(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:SL :SC :SG - one of three; the third one, or a pause, hands them on."""
    values = given(values)
    session.check_may_set()
    draft = _draft(session)
    draft.touched = session.clock()
    if command.name == "SG":
        _keep_local_time(session, draft, -values["offset"])
        session.kept.offset = draft.offset = -values["offset"]
    elif command.name == "SL":
        draft.time = values["time"], session.clock()
        draft.carried -= {"time"}
    else:
        draft.day = values["date"]
        session.kept.dated = values["date"], session.clock()
        draft.carried -= {"day"}
    if draft.complete:
        yield from commit(session)
    else:
        yield Defer(QUIET, "commit_quiet")
    return _said(session) if command.name == "SC" else None


def _said(session: LxSession) -> dict[str, str]:
    """What :SC answers: as the mount itself does where that is presented, else in the columns that one needs."""
    if session.model.get("own"):
        return {"text": session.model["date_text"], "blank": " " * session.model["date_blanks"]}
    return {"text": _TEXT, "blank": " " * 32}


def _keep_local_time(session: LxSession, draft: Draft, offset: float) -> None:
    """A new offset for a local time that was handed on a moment ago: the time goes on, UTC is another one.

    ``carried`` is what comes of that and not of this client's next pieces, which may follow yet.
    """
    if session.kept.local is None or draft.time is not None:
        return
    day, seconds, at, with_offset = session.kept.local
    if offset != with_offset and session.clock() - at <= BELONGS:
        draft.carried = frozenset({"time"} if draft.day is not None else {"time", "day"})
        draft.time = (seconds, at)
        draft.day = draft.day or day


def commit_quiet(session: LxSession, command: Command | None, values: op.Values) -> Handling:
    """After the pause: hand on what is there, unless another piece has come meanwhile."""
    if session.clock() - _draft(session).touched >= QUIET - 0.1:
        yield from commit(session)


def commit(session: LxSession) -> Handling:
    """Hand the drafted time and date on as one instant."""
    draft = _draft(session)
    pieces = copy(draft)
    draft.clear()
    if pieces.time is None and pieces.day is None:
        return
    try:
        present: op.Moment = yield op.GetClock()
    except Fault:
        present = op.Moment(session.clock(), 0.0)
    # A draft goes on with the next connection, and the pause of the one before may hand it on: it carries its offset.
    offset = next((told for told in (pieces.offset, session.kept.offset) if told is not None), present.offset)
    now = datetime.fromtimestamp(present.unix + offset * 3600.0, UTC)
    day = pieces.day or now.date()
    if pieces.time is not None:
        day = pieces.day or _dated(session) or day
        seconds, at = pieces.time
        elapsed = session.clock() - at
    else:
        seconds, elapsed = now.hour * 3600 + now.minute * 60 + now.second + now.microsecond / 1e6, 0.0
    if pieces.time is not None or session.kept.local is not None:
        session.kept.local = day, seconds, session.clock() - elapsed, offset
    local = pieces.stamped or not session.model.get("utc_date")
    yield op.SetClock(_instant(session, day, seconds, offset, local) + elapsed, offset)


def _dated(session: LxSession) -> date | None:
    """The date that this client set a moment ago: a zone that came since has not made it another day."""
    if session.kept.dated is None:
        return None
    day, at = session.kept.dated
    return day if session.clock() - at <= BELONGS else None


def _instant(session: LxSession, day: date, seconds: float, offset: float, is_local: bool) -> float:
    """Unix seconds of a local time. ``is_local``: the date can be no other than the local one.

    An LX200GPS is told the UTC date by the manual and the local one by some programs: the reading nearer the host's
    clock counts, and the manual's where that clock shows another day altogether.
    """
    midnight = float(calendar.timegm(day.timetuple()))
    local = midnight + seconds - offset * 3600.0
    if is_local:
        return local
    universal = midnight + (seconds - offset * 3600.0) % 86400.0
    nearer = min(local, universal, key=lambda unix: abs(unix - session.clock()))
    return nearer if abs(nearer - session.clock()) <= HOST_KNOWS else universal


def set_stamp(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:hIyyMMddHHmmss - date and local time at once."""
    session.check_may_set()
    try:
        local = datetime.strptime(values.get("stamp", ""), "%y%m%d%H%M%S").replace(tzinfo=UTC)
    except ValueError:
        raise Invalid("The stamp is yyMMddHHmmss.") from None
    draft = _draft(session)
    draft.day, draft.stamped = local.date(), True
    draft.time = (local.hour * 3600 + local.minute * 60 + local.second, session.clock())
    yield from commit(session)


def tell_sidereal(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:GS - apparent, from the mount's clock and site."""
    yield from _commit_if_allowed(session)
    sidereal: float = yield op.SiderealTime()
    return {"sidereal": sidereal % 360.0}


def set_sidereal(session: LxSession, command: Command, values: op.Values) -> None:
    """:SS - a mount has no sidereal clock of its own: it follows from clock and site. Raises Unsupported."""
    raise Unsupported("The sidereal time follows from the mount's clock and site: :SL, :SC, :SG and :Sg set those.")


def toggle_hours(session: LxSession, command: Command, values: op.Values) -> None:
    """:H"""
    session.kept.twelve = not session.kept.twelve


def tell_hours(session: LxSession, command: Command, values: op.Values) -> dict[str, str]:
    """:Gc"""
    return {"hours": "12" if session.kept.twelve else "24"}


# --- the GPS of an LX200GPS: the mount's own unit; without one, or without a fix, nothing says that there is one ---


def gps_sentence(session: LxSession, command: Command, values: op.Values) -> Handling:
    """:gps - one RMC sentence; without a fix one that says so (V), with the site and the clock in force."""
    try:
        seen: op.Gps = yield op.GetGps()
    except (Unsupported, NoDevice):
        seen = op.Gps(linked=False)
    place: op.Place = seen.place or (yield op.GetSite())
    moment: op.Moment = yield op.GetClock()
    return {"text": rmc(place.latitude, place.longitude, seen.unix or moment.unix, seen.linked)}
