"""The devices behind a hand control: two motors always, a GPS unit and a clock on some models, nothing else.

A command to a device that is not there, and one that no device knows, gets the no-response form: as many bytes as
were asked for, one more, ``#`` (NexStar protocol, Pass-through Commands with No Response). So does firmware upload.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from gateway.errors import NoDevice, Unsupported
from gateway.operations import GetClock, GetGps, GetSite, Gps, Moment, Place, SetClock
from gateway.surface import Handling, Session
from gateway.tables import Command, parse_version

MOTORS = {16: 1, 17: 2}
GPS, RTC = 176, 178
#: Years that a hand control can tell.
CENTURY = range(2000, 2100)
#: Not passed on even where the mount is a NexStar, too: one would make the alignment meaningless, the other moves the
#: mount where no limit is known. (Firmware upload and memory writes are no commands here at all.)
NEVER_PASSED = frozenset({"axis_set_position", "level_start"})
#: Of the devices that can be told to move, this one alone: the number 0 reaches all of them, the motors too.
MOVERS, FOCUSER = frozenset({"move_pos", "move_neg"}), 18
SETTINGS = (b"R", b"r", b"B", b"b", b"S", b"s", b"T", b"W", b"H", b"I")


def motor(values: dict[str, Any]) -> int:
    """The axis (1, 2) of the motor that a command speaks to. Raises NoDevice."""
    axis = MOTORS.get(values["device"])
    if axis is None:
        raise NoDevice
    return axis


def passes(name: str, values: Mapping[str, Any]) -> bool:
    """Whether a command that means nothing here may go to a NexStar mount as it is: none moves it past the limits."""
    return name not in NEVER_PASSED and (name not in MOVERS or values["device"] == FOCUSER)


def version(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
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


def _require(session: Session, part: str) -> None:
    if part not in session.model["has"]:
        raise NoDevice


def _receiver(session: Session) -> Handling:
    """What the mount's own receiver tells; one presented over a mount without any is site and clock."""
    _require(session, "gps")
    try:
        return (yield GetGps())
    except (Unsupported, NoDevice):
        place: Place = yield GetSite()
        moment: Moment = yield GetClock()
        return Gps(True, place, moment.unix)


def gps_flag(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """Linked, and time valid."""
    linked = int((yield from _receiver(session)).linked)
    return {"linked": linked, "valid": linked}


def gps_place(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """Latitude and longitude; before the first fix those of the site."""
    place = (yield from _receiver(session)).place or (yield GetSite())
    return {"latitude": place.latitude, "longitude": place.longitude}


def gps_time(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """Date, year and time by the satellites; before the first fix by the mount's clock."""
    seen = yield from _receiver(session)
    return _calendar(seen.unix if seen.linked else (yield GetClock()).unix)


def universal_time(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """Date, year and time of the clock: always UT."""
    _require(session, "rtc")
    return _calendar((yield GetClock()).unix)


def _calendar(unix: float) -> dict[str, int]:
    now = datetime.fromtimestamp(unix, UTC)
    return {"month": now.month, "day": now.day, "year": now.year, "hour": now.hour, "minute": now.minute,
            "second": now.second}


def set_clock(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """Set date, year, time of the clock: each changes its own part of UT, an impossible one nothing."""
    _require(session, "rtc")
    if not command.known_to(None, session.model["version"]):
        raise NoDevice
    moment: Moment = yield GetClock()
    try:
        now = datetime.fromtimestamp(moment.unix, UTC).replace(**values)
    except ValueError:
        return
    if now.year in CENTURY:
        yield SetClock(now.timestamp(), moment.offset, moment.dst)


def absent(session: Session, command: Command, values: dict[str, Any]) -> None:
    """A device or a function that no mount behind this gateway has."""
    raise NoDevice


def no_response(frame: bytes) -> bytes:
    """The answer to a pass-through command that nobody answers; settings that do nothing are acknowledged too."""
    if frame[:1] == b"P":
        return bytes(frame[7] + 1) + b"#"
    return b"#" if frame[:1] in SETTINGS else b""
