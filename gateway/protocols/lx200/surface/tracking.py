"""Alignment mode, tracking and its rate in hertz.

Meade counts the rate as the frequency of a synchronous motor: 60 Hz is a turn in 24 hours, so sidereal is 60.164 Hz,
printed 60.1; that is also what programs send when they mean sidereal. Told is the rate that runs whenever the mount
tracks, whoever has set it; one that cannot run is refused.
"""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core.errors import Fault, Invalid, NotAligned
from gateway.core.operations import DriveRate, GetStatus, SetTracking, Status, Tracking, TrackRate, Values
from gateway.protocols.base.wants import FireAndForget, Handling, given
from gateway.protocols.lx200.session import LxSession
from gateway.protocols.wireformat.command import Command

SIDEREAL_HERTZ = 60.16427
#: What counts as sidereal, and how it is told; the highest frequency that can be told.
_SIDEREAL, _SIDEREAL_TOLD, _MOST = (60.1, 60.2), 60.1, 99.9
_NAMED = {"TQ": "sidereal", "TS": "solar", "TL": "lunar"}
_MENU = ("ALTAZ", "POLAR", "LAND")


def alignment(session: LxSession, command: Command, values: Values) -> Handling:
    """ACK - L only to a client that asked for land mode: widely used programs fail on it."""
    return {"mode": (yield from _letter(session))}


def _letter(session: LxSession) -> Handling:
    status: Status = yield GetStatus()
    if session.kept.land and status.tracking is Tracking.OFF:
        return "L"
    return "P" if status.equatorial else "A"


def menu(session: LxSession, command: Command, values: Values) -> Handling:
    """:G0 :G1 :G2 - the alignment menu, the present mode marked."""
    index = int(command.name[1])
    letter = yield from _letter(session)
    return {"text": f"{'>' if _MENU[index].startswith(letter) else ' '}{_MENU[index]:<15}"}


def status(session: LxSession, command: Command, values: Values) -> Handling:
    """:GW - how it is built, whether it tracks, whether it is aligned."""
    seen: Status = yield GetStatus()
    return {
        "build": "G" if session.model.get("build") == "G" else "P" if seen.equatorial else "A",
        "tracking": "N" if seen.tracking is Tracking.OFF else "T",
        "aligned": "1" if seen.aligned else "0",
    }


def align(session: LxSession, command: Command, values: Values) -> Handling:
    """:Aa - a hand control cannot be aligned from outside: 1 when it is aligned already, else 0."""
    seen: Status = yield GetStatus()
    if not seen.aligned:
        raise NotAligned


def land(session: LxSession, command: Command, values: Values) -> Handling:
    """:AL - tracking off. What comes next is told what became of it."""
    session.kept.land = True
    yield SetTracking(on=False)


def track(session: LxSession, command: Command, values: Values) -> Handling:
    """:AA :AP - tracking on, in the mount's own mode: its alignment must survive."""
    session.kept.land = False
    yield FireAndForget(SetTracking(on=True))


def named_rate(session: LxSession, command: Command, values: Values) -> Handling:
    """:TQ :TS :TL"""
    yield TrackRate(name=_NAMED[command.name])


def tell_hertz(session: LxSession, command: Command, values: Values) -> Handling:
    """:GT - also while it does not track, never 0: whether it does is in :GW."""
    try:
        factor: float = yield DriveRate()
    except Fault:
        return {"hertz": _SIDEREAL_TOLD}
    hertz = round(factor * SIDEREAL_HERTZ, 1)
    return {"hertz": _SIDEREAL_TOLD if _SIDEREAL[0] <= hertz <= _SIDEREAL[1] else min(_MOST, hertz)}


def set_hertz(session: LxSession, command: Command, values: Values) -> Handling:
    """:ST :T<ddd.ddd> - from now on at this rate; 60.1 to 60.2 is sidereal exactly."""
    hertz = given(values)["hertz"]
    if not 0 < hertz < 100:
        raise Invalid("The tracking rate is given in hertz, 60.1 for sidereal.")
    yield from _drive_at(session, hertz)


def custom(session: LxSession, command: Command, values: Values) -> Handling:
    """:TM :T+ :T- - the manual rate, a tenth of a hertz more or less."""
    step = {"TM": 0.0, "T+": 0.1, "T-": -0.1}[command.name]
    hertz = round((session.shared.manual_hertz or 60.1) + step, 3)
    yield from _drive_at(session, max(0.1, min(99.9, hertz)))


def _drive_at(session: LxSession, hertz: float) -> Handling:
    sidereal = _SIDEREAL[0] <= round(hertz, 3) <= _SIDEREAL[1]
    yield TrackRate(name="sidereal") if sidereal else TrackRate(factor=hertz / SIDEREAL_HERTZ)
    session.set_for_all(replace(session.shared, manual_hertz=hertz), lasting=False)  # not one that was refused
