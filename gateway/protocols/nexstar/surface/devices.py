"""The devices behind a hand control: two motors and a focuser always, a GPS unit and a clock on some models.

A command to a device that is not there, and one that no device knows, gets the no-response form: as many bytes as
were asked for, one more, ``#`` (NexStar protocol, Pass-through Commands with No Response). So does firmware upload.
"""

from __future__ import annotations

from datetime import UTC, datetime

from gateway.core import operations as op
from gateway.core.errors import Asleep, Fault, Invalid, NoAnswer, NoDevice, Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling, Possible
from gateway.protocols.nexstar.counting import fields_of
from gateway.protocols.nexstar.session import NexStarSession, begin
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.rows import parse_version

MOTORS = {16: 1, 17: 2}
GPS, RTC = 176, 178
#: Years that a hand control can tell.
CENTURY = range(2000, 2100)
#: Not passed on even where the mount is a NexStar, too: one would make the alignment meaningless, the other moves the
#: mount where no limit is known. (Firmware upload and memory writes are no commands here at all.)
NEVER_PASSED = frozenset({"axis_set_position", "level_start"})
#: Of the devices that can be told to move, this one alone: the number 0 reaches all of them, the motors too.
MOVERS, FOCUSER = frozenset({"move_pos", "move_neg"}), 18
#: What is acknowledged whatever becomes of it: there is no form for no.
ACKNOWLEDGED = (b"R", b"r", b"B", b"b", b"S", b"s", b"T", b"W", b"H", b"I", b"x", b"y")
#: Keys 1-9 of a focuser as the four speeds of a Meade.
FOCUS_SPEEDS = (1, 1, 2, 2, 3, 3, 4, 4, 4)
#: What the search for a switch has come to.
FOUND, SEARCHING = 1, 2


def motor(values: op.Values) -> int:
    """The axis (1, 2) of the motor that a command speaks to. Raises NoDevice."""
    axis = MOTORS.get(values["device"])
    if axis is None:
        raise NoDevice
    return axis


def passes(name: str, values: op.Values) -> bool:
    """Whether a command that means nothing here may go to a NexStar mount as it is: none moves it past the limits."""
    return name not in NEVER_PASSED and (name not in MOVERS or values["device"] == FOCUSER)


def device_version(session: NexStarSession, command: Command, values: op.Values) -> dict[str, int]:
    """AUX 0xFE - what is asked for beyond two bytes is the build number."""
    device = values["device"]
    if device in MOTORS:
        major, minor = parse_version(session.model["motors"])[:2]
        return {"major": major, "minor": minor, "build": 0}
    if device == GPS and "gps" in session.model["has"]:
        return {"major": 1, "minor": 6, "build": 0}
    if device == RTC and "rtc" in session.model["has"]:
        return {"major": 1, "minor": 1, "build": 0}
    raise NoDevice


def _require(session: NexStarSession, part: str) -> None:
    if part not in session.model["has"]:
        raise NoDevice


def _receiver(session: NexStarSession) -> Handling:
    """What the mount's own receiver tells; one presented over a mount without any has no fix, but site and clock."""
    _require(session, "gps")
    try:
        return (yield op.GetGps())
    except (Unsupported, NoDevice):
        place: op.Place = yield op.GetSite()
        moment: op.Moment = yield op.GetClock()
        return op.Gps(False, place, moment.unix)


def gps_flag(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Linked, and time valid."""
    linked = int((yield from _receiver(session)).linked)
    return {"linked": linked, "valid": linked}


def gps_place(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Latitude and longitude; before the first fix those of the site."""
    place = (yield from _receiver(session)).place or (yield op.GetSite())
    return {"latitude": place.latitude, "longitude": place.longitude}


def gps_time(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Date, year and time by the satellites; before the first fix by the mount's clock."""
    seen = yield from _receiver(session)
    return _calendar(seen.unix if seen.linked else (yield op.GetClock()).unix)


def universal_time(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Date, year and time of the clock: always UT."""
    _require(session, "rtc")
    return _calendar((yield op.GetClock()).unix)


def _calendar(unix: float) -> dict[str, int]:
    now = datetime.fromtimestamp(unix, UTC)
    return {**fields_of(now), "year": now.year}


def set_rtc(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Set date, year, time of the clock: each changes its own part of UT. Raises Invalid for an impossible one."""
    _require(session, "rtc")
    if not command.known_to(None, session.model["counts_as"]):
        raise NoDevice
    yield Possible(op.SetClock(0.0, 0.0))
    moment: op.Moment = yield op.GetClock()
    try:
        now = datetime.fromtimestamp(moment.unix, UTC).replace(**values)
    except ValueError:
        raise Invalid from None
    if now.year not in CENTURY:
        raise Invalid
    yield op.SetClock(now.timestamp(), moment.offset, moment.dst)


def seek_switch(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """AUX 0x0B - the search goes for both axes; the motor that is asked second finds it under way."""
    motor(values)
    yield Possible(op.Home())
    if (yield op.HomeState()) != SEARCHING:
        yield op.Home()


def switch_found(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """AUX 0x12 - 255 when it was found, 0 before and when it was not."""
    motor(values)
    return {"done": 255 if (yield op.HomeState()) == FOUND else 0}


def move_focuser(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """AUX 0x24, 0x25 of the focuser, whose positions count outwards; 0 stops it. Raises NoDevice, Invalid."""
    rate = values["rate"]
    if values["device"] != FOCUSER:
        raise NoDevice
    if rate == 0:
        yield FireAndForget(op.Focus(0))
    elif rate > len(FOCUS_SPEEDS):
        raise Invalid
    else:
        yield from begin(op.Focus(-1 if command.name == "move_pos" else 1, FOCUS_SPEEDS[rate - 1]))


def absent(session: NexStarSession, command: Command, values: op.Values) -> None:
    """A device or a function that no mount behind this gateway has."""
    raise NoDevice


def no_response(frame: bytes, fault: Fault | None) -> bytes:
    """The answer to a pass-through command that nobody answers; settings that do nothing are acknowledged too.

    A mount that does not answer is no yes.
    """
    if frame[:1] == b"P":
        return bytes(frame[7] + 1) + b"#"
    if isinstance(fault, NoAnswer) and not isinstance(fault, Asleep):
        return b""
    return b"#" if frame[:1] in ACKNOWLEDGED else b""
