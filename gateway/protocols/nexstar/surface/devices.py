"""The devices behind a hand control: two motors and a focuser always, a GPS unit and a clock on some models.

A command to a missing device, or a command that no device has, gets the no-response form: one byte more than the
client asked for, then ``#`` (NexStar protocol, Pass-through Commands with No Response). Firmware upload gets it too.
"""

from __future__ import annotations

from datetime import UTC, datetime

from gateway.core import operations as op
from gateway.core.errors import Asleep, Fault, Invalid, NoAnswer, NoDevice, Unsupported
from gateway.protocols.base.wants import CheckPossible, FireAndForget, Handling
from gateway.protocols.nexstar.counting import clock_fields
from gateway.protocols.nexstar.session import NexStarSession, begin
from gateway.protocols.wireformat.command import Command
from gateway.protocols.wireformat.rows import parse_version

AXIS_BY_DEVICE = {16: 1, 17: 2}
GPS, RTC = 176, 178
#: Years that a hand control can represent.
VALID_YEARS = range(2000, 2100)
#: Not passed on even to a NexStar mount: the first would make the alignment meaningless, the second moves the mount to
#: where no limit is known. (Firmware upload and memory writes are no commands here at all.)
NEVER_PASSED = frozenset({"axis_set_position", "level_start"})
#: Move commands are passed on to the focuser only: device 0 would reach all devices, the motors too.
MOVE_COMMANDS, FOCUSER = frozenset({"move_pos", "move_neg"}), 18
#: Commands that are always acknowledged, because the protocol has no reply that means no.
ACKNOWLEDGED = (b"R", b"r", b"B", b"b", b"S", b"s", b"T", b"W", b"H", b"I", b"x", b"y")
#: The four focuser speeds of a Meade for keys 1-9.
FOCUS_SPEEDS = (1, 1, 2, 2, 3, 3, 4, 4, 4)
#: States of homing, as ``HomeState`` returns them.
FOUND, SEARCHING = 1, 2


def addressed_axis(values: op.Values) -> int:
    """Return the axis (1, 2) of the motor that a command addresses. Raises NoDevice for any other device."""
    axis = AXIS_BY_DEVICE.get(values["device"])
    if axis is None:
        raise NoDevice
    return axis


def may_be_passed_on(command: str, values: op.Values) -> bool:
    """Whether a command may be passed on to a NexStar mount: not if it could pass a limit or spoil the alignment."""
    return command not in NEVER_PASSED and (command not in MOVE_COMMANDS or values["device"] == FOCUSER)


def device_version(session: NexStarSession, values: op.Values) -> dict[str, int]:
    """AUX 0xFE - the firmware version of a device; bytes beyond the first two are the build. Raises NoDevice."""
    device = values["device"]
    if device in AXIS_BY_DEVICE:
        major, minor = parse_version(session.model["motors"])[:2]
        return {"major": major, "minor": minor, "build": 0}
    if device == GPS and "gps" in session.model["has"]:
        return {"major": 1, "minor": 6, "build": 0}
    if device == RTC and "rtc" in session.model["has"]:
        return {"major": 1, "minor": 1, "build": 0}
    raise NoDevice


def _require_part(session: NexStarSession, part: str) -> None:
    if part not in session.model["has"]:
        raise NoDevice


def _read_receiver(session: NexStarSession) -> Handling:
    """Return Gps; the site and clock, without a fix, if the mount has no receiver. NoDevice if the model has none."""
    _require_part(session, "gps")
    try:
        return (yield op.GetGps())
    except (Unsupported, NoDevice):
        place: op.Place = yield op.GetSite()
        moment: op.Moment = yield op.GetClock()
        return op.Gps(False, place, moment.unix)


def gps_flag(session: NexStarSession) -> Handling:
    """Whether the GPS has a fix (linked), and so a valid time."""
    linked = int((yield from _read_receiver(session)).linked)
    return {"linked": linked, "valid": linked}


def gps_place(session: NexStarSession) -> Handling:
    """Latitude and longitude by GPS; before the first fix those of the site."""
    place = (yield from _read_receiver(session)).place or (yield op.GetSite())
    return {"latitude": place.latitude, "longitude": place.longitude}


def gps_time(session: NexStarSession) -> Handling:
    """Date, year and time by GPS; before the first fix by the mount's clock."""
    receiver = yield from _read_receiver(session)
    return _date_fields(receiver.unix if receiver.linked else (yield op.GetClock()).unix)


def universal_time(session: NexStarSession) -> Handling:
    """Date, year and time in UT, by the mount's clock. Raises NoDevice if the model has no real-time clock."""
    _require_part(session, "rtc")
    return _date_fields((yield op.GetClock()).unix)


def _date_fields(unix: float) -> dict[str, int]:
    now = datetime.fromtimestamp(unix, UTC)
    return {**clock_fields(now), "year": now.year}


def set_rtc(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """Set one of date, year and time of the real-time clock (UT). Raises Invalid if impossible, NoDevice without it."""
    _require_part(session, "rtc")
    if not command.exists_on(None, session.model["counts_as"]):
        raise NoDevice
    yield CheckPossible(op.SetClock(0.0, 0.0))
    moment: op.Moment = yield op.GetClock()
    try:
        now = datetime.fromtimestamp(moment.unix, UTC).replace(**values)
    except ValueError:
        raise Invalid from None
    if now.year not in VALID_YEARS:
        raise Invalid
    yield op.SetClock(now.timestamp(), moment.offset, moment.dst)


def seek_switch(values: op.Values) -> Handling:
    """AUX 0x0B - send both axes home, unless they are on the way: programs send this to each of the motors."""
    addressed_axis(values)
    yield CheckPossible(op.Home())
    if (yield op.HomeState()) != SEARCHING:
        yield op.Home()


def tell_switch_found(values: op.Values) -> Handling:
    """AUX 0x12 - 255 if the mount is at home (or parked), else 0."""
    addressed_axis(values)
    return {"done": 255 if (yield op.HomeState()) == FOUND else 0}


def move_focuser(command: Command, values: op.Values) -> Handling:
    """AUX 0x24, 0x25 - move the focuser; positions increase outwards, 0 stops it.

    Raises NoDevice for any other device, and Invalid for a rate above 9.
    """
    rate = values["rate"]
    if values["device"] != FOCUSER:
        raise NoDevice
    if rate == 0:
        yield FireAndForget(op.Focus(0))
    elif rate > len(FOCUS_SPEEDS):
        raise Invalid
    else:
        yield from begin(op.Focus(-1 if command.name == "move_pos" else 1, FOCUS_SPEEDS[rate - 1]))


def refuse_absent() -> None:
    """Raise NoDevice: no mount behind this gateway has such a device or function."""
    raise NoDevice


def refuse_set_position(session: NexStarSession, command: Command) -> None:
    """AUX 0x04 - never carried out. Raises NoDevice; a SynScan replies ``#``, as documented."""
    if "dialect" not in session.model:
        raise NoDevice
    session.refusal_reason = f"{command.help}: it would make the alignment meaningless"


def no_response(frame: bytes, fault: Fault | None) -> bytes:
    """Return the reply to a refused command: the no-response form to a pass-through command, else ``#`` or nothing.

    Other commands get an empty reply if the mount does not answer, because ``#`` would mean yes.
    """
    if frame[:1] == b"P":
        return bytes(frame[7] + 1) + b"#"
    if isinstance(fault, NoAnswer) and not isinstance(fault, Asleep):
        return b""
    return b"#" if frame[:1] in ACKNOWLEDGED else b""
