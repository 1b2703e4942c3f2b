"""All motions but gotos: motion by hand, its rates, guiding, tracking and its rate, the alignment mode.

Meade gives the tracking rate as the frequency of a synchronous motor: 60 Hz is one turn in 24 hours, so sidereal is
60.164 Hz, printed 60.1; programs send 60.1 too when they mean sidereal. Replies report the rate at which the mount
tracks, whichever client has set it; a rate that the mount cannot run at is refused.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.astro.spherical import SIDEREAL_ARCSEC_PER_S
from gateway.core import operations as op
from gateway.core.errors import Fault, Invalid, NotAligned
from gateway.protocols.base.wants import FireAndForget, Handling, decoded
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

_RATE_NAME_BY_COMMAND = {"RG": "guide", "RC": "center", "RM": "find", "RS": "max"}
MAX_PULSE_MS = 60_000  # milliseconds
SIDEREAL_HERTZ = 60.16427
#: Accepted: a drive rate in hertz, a guide rate in arcseconds a second (up to twice sidereal), the rate of an axis in
#: degrees a second. Other values have another meaning, such as iOptron's :ST1#, which starts tracking.
HERTZ_RANGE, GUIDE_RANGE, AXIS_RATE_RANGE = (50.0, 70.0), (0.0, 30.1), (0.0, 20.0)
#: The range that counts as sidereal, and the value reported for it; the highest frequency that can be reported.
_SIDEREAL_RANGE, _REPORTED_SIDEREAL, _MAX_HZ = (60.1, 60.2), 60.1, 99.9
_DRIVE_RATE_BY_COMMAND = {"TQ": "sidereal", "TS": "solar", "TL": "lunar"}
_MODE_NAMES = ("ALTAZ", "POLAR", "LAND")


def move(session: LxSession, command: Command) -> Handling:
    """:Mn :Ms :Me :Mw - motion by hand at this client's rate."""
    direction = op.Direction(command.name[1])
    client = session.client
    of_axis = client.rate_ra if direction.axis == 1 else client.rate_dec
    rate = client.rate or op.Rate(name="center")
    if of_axis:
        rate = op.Rate(degrees=of_axis if client.fastest is None else min(of_axis, client.fastest))
    elif rate.name == "max" and client.fastest is not None:
        rate = op.Rate(name="max", degrees=client.fastest)
    yield FireAndForget(op.Move(direction, rate, lowest=client.lowest, highest=client.highest))


def _valid_rate(allowed_range: tuple[float, float], value: float, unit: str) -> float:
    """Return the value. Raises Invalid if it is out of the allowed range."""
    low, high = allowed_range
    if not low <= value <= high:
        raise Invalid(f"{value:g} is out of range: {low:g} to {high:g} {unit}.")
    return value


def choose_rate(session: LxSession, command: Command, values: op.Values) -> None:
    """:RG :RC :RM :RS :R<n> - choose the rate of motion by hand, of both axes; n is the number of a key, 0 means 1."""
    name = _RATE_NAME_BY_COMMAND.get(command.name)
    session.client.rate = op.Rate(name=name) if name else op.Rate(key=max(1, decoded(values)["key"]))
    session.client.rate_ra = session.client.rate_dec = None


def set_axis_rate(session: LxSession, command: Command, values: op.Values) -> None:
    """:RA :RE - the rate of hand motion of one axis, degrees per second (0: none), until :RG :RC :RM :RS or :R<n>."""
    rate = _valid_rate(AXIS_RATE_RANGE, decoded(values)["rate"], "degrees a second") or None
    if command.name == "RA":
        session.client.rate_ra = rate
    else:
        session.client.rate_dec = rate


def set_max_rate(session: LxSession, values: op.Values) -> None:
    """:Sw - set the fastest rate of this client and choose it: some programs use the command as a rate slider."""
    low, high = session.model["max_rates"]
    if "fault" in values or not low <= values["rate"] <= max(high, 8):
        raise Invalid(f"The slew rate is {low} to {high} degrees a second.")
    session.client.fastest = float(values["rate"])
    session.client.rate = op.Rate(name="max")


def set_guide_rate(values: op.Values) -> Handling:
    """:Rg - the guide rate of both axes, arcseconds per second, at most sidereal."""
    fraction = min(
        1.0, _valid_rate(GUIDE_RANGE, decoded(values)["rate"], "arcseconds a second") / SIDEREAL_ARCSEC_PER_S
    )
    for axis in (1, 2):
        yield FireAndForget(op.SetGuideRate(axis, fraction))


def pulse(session: LxSession, values: op.Values) -> Handling:
    """:Mg - a guide pulse of so many milliseconds, at most 60 000."""
    values = decoded(values)
    direction, by_sky = op.Direction(values["direction"]), session.client_settings.guides_by_sky
    yield FireAndForget(op.Pulse(direction, min(values["ms"], MAX_PULSE_MS), by_sky))


# --- tracking ---------------------------------------------------------------------------------------------------------


def alignment(session: LxSession) -> Handling:
    """ACK - the alignment mode. L is only sent to a client that requested land mode: some programs fail on it."""
    return {"mode": (yield from _mode_letter(session))}


def _mode_letter(session: LxSession) -> Handling:
    status: op.Status = yield op.GetStatus()
    if session.client.land_mode and status.tracking is op.Tracking.OFF:
        return "L"
    return "P" if status.equatorial else "A"


def tell_menu_line(session: LxSession, command: Command) -> Handling:
    """:G0 :G1 :G2 - a line of the alignment menu, with a mark if it shows the present mode."""
    index = int(command.name[1])
    letter = yield from _mode_letter(session)
    return {"text": f"{'>' if _MODE_NAMES[index].startswith(letter) else ' '}{_MODE_NAMES[index]:<15}"}


def status(session: LxSession) -> Handling:
    """:GW - mount type, tracking, alignment."""
    state: op.Status = yield op.GetStatus()
    return {
        "build": "G" if session.model.get("build") == "G" else "P" if state.equatorial else "A",
        "tracking": "N" if state.tracking is op.Tracking.OFF else "T",
        "aligned": "1" if state.aligned else "0",
    }


def check_alignment() -> Handling:
    """:Aa - reply 1 if the mount is aligned already, else 0: a hand control cannot be aligned from outside."""
    state: op.Status = yield op.GetStatus()
    if not state.aligned:
        raise NotAligned


def set_land_mode(session: LxSession) -> Handling:
    """:AL - turn tracking off, and wait until the mount has done so: the next reply then reports the new state."""
    session.client.land_mode = True
    yield op.SetTracking(on=False)


def turn_tracking_on(session: LxSession) -> Handling:
    """:AA :AP - tracking on, in the mount's own mode, so that its alignment is kept."""
    session.client.land_mode = False
    yield FireAndForget(op.SetTracking(on=True))


def set_named_rate(command: Command) -> Handling:
    """:TQ :TS :TL - select the tracking rate."""
    yield op.TrackRate(name=_DRIVE_RATE_BY_COMMAND[command.name])


def tell_hertz() -> Handling:
    """:GT - the tracking rate, hertz; never 0, even while the mount does not track (:GW reports that)."""
    try:
        factor: float = yield op.DriveRate()
    except Fault:
        return {"hertz": _REPORTED_SIDEREAL}
    hertz = round(factor * SIDEREAL_HERTZ, 1)
    return {"hertz": _REPORTED_SIDEREAL if _SIDEREAL_RANGE[0] <= hertz <= _SIDEREAL_RANGE[1] else min(_MAX_HZ, hertz)}


def set_hertz(session: LxSession, values: op.Values) -> Handling:
    """:ST :T<ddd.ddd> - set the tracking rate; 60.1 to 60.2 means exactly sidereal."""
    yield from _set_drive_hertz(session, _valid_rate(HERTZ_RANGE, decoded(values)["hertz"], "hertz, 60.1 for sidereal"))


def set_manual_rate(session: LxSession, command: Command) -> Handling:
    """:TM :T+ :T- - track at the manual rate, at first 60.1 hertz; :T+ and :T- change it by 0.1 hertz before."""
    step = {"TM": 0.0, "T+": 0.1, "T-": -0.1}[command.name]
    hertz = round((session.shared.manual_hertz or 60.1) + step, 3)
    yield from _set_drive_hertz(session, max(HERTZ_RANGE[0], min(HERTZ_RANGE[1], hertz)))


def _set_drive_hertz(session: LxSession, hertz: float) -> Handling:
    sidereal = _SIDEREAL_RANGE[0] <= round(hertz, 3) <= _SIDEREAL_RANGE[1]
    yield op.TrackRate(name="sidereal") if sidereal else op.TrackRate(factor=hertz / SIDEREAL_HERTZ)
    session.replace_shared(replace(session.shared, manual_hertz=hertz), save=False)  # only reached if not refused
