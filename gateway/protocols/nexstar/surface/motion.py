"""Motors: fixed and variable rates, guiding, tracking. Motor sense is kept: a program's north is never "corrected"."""

from __future__ import annotations

from typing import Any

from gateway.errors import Fault
from gateway.operations import (
    Backlash,
    GetStatus,
    Halt,
    MoveAxis,
    PeriodicError,
    PulseAxis,
    Rate,
    SetGuideRate,
    SetTracking,
    Sleep,
    Status,
    Tracking,
    TrackRate,
    Wake,
)
from gateway.protocols.nexstar.surface.devices import motor
from gateway.surface import Handling, Session, Start
from gateway.tables import Command

_TRACKING = {0xFFFF: "sidereal", 0xFFFE: "solar", 0xFFFD: "lunar"}
_MODES = {0: Tracking.OFF, 1: Tracking.ALTAZ, 2: Tracking.EQ_NORTH, 3: Tracking.EQ_SOUTH}


def _axis_and_sense(command: Command) -> tuple[int, int]:
    """From the name of the row: ``slew_azm_pos`` is axis 1, +1."""
    _, axis, sense = command.name.split("_")
    return (1 if axis == "azm" else 2), (1 if sense == "pos" else -1)


def fixed(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x24, 0x25 - a hand-control key 1-9; 0 stops the axis."""
    axis, sense = _axis_and_sense(command)
    if values["rate"] == 0:
        yield Start(Halt(axis))
    else:
        yield Start(MoveAxis(axis, sense, Rate(key=min(9, values["rate"]))))


def variable(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x06, 0x07 - quarter arcseconds a second; the three highest codes are tracking rates."""
    axis, sense = _axis_and_sense(command)
    yield from _rate(axis, sense, values["rate"] / 14400.0, _TRACKING.get(values["rate"]))


def fine(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """The same in 1/1024 arcseconds a second."""
    axis = motor(values)
    yield from _rate(axis, 1 if command.name.endswith("pos") else -1, values["rate"] / 1024.0 / 3600.0, None)


def _rate(axis: int, sense: int, degrees: float, tracking: str | None) -> Handling:
    if tracking is not None:
        yield Start(TrackRate(name=tracking))
    elif degrees == 0:
        yield Start(Halt(axis))
    else:
        yield Start(MoveAxis(axis, sense, Rate(degrees=degrees)))


def mode(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """t - binary, as this version counts it."""
    status: Status = yield GetStatus()
    wanted = status.tracking
    if wanted.equatorial and session.shared.get("asked mode") in (2, 3):
        return {"mode": session.shared["asked mode"]}
    return {"mode": next(code for code, known in _MODES.items() if known is wanted)}


def set_mode(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """T - a mode above 3 does nothing."""
    wanted = _MODES.get(values["mode"])
    if wanted is None:
        return
    try:
        yield SetTracking(on=wanted is not Tracking.OFF, mode=wanted)
    except Fault:
        return


def pulse(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x26 - percent of sidereal for hundredths of a second."""
    axis, ms = motor(values), values["ticks"] * 10
    session.kept.setdefault("pulse ends", {})[axis] = session.clock() + ms / 1000.0
    if values["rate"] and ms:
        yield Start(PulseAxis(axis, 1 if values["rate"] > 0 else -1, ms))


def pulse_active(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """AUX 0x27"""
    ends = session.kept.get("pulse ends", {}).get(motor(values), 0.0)
    return {"active": int(session.clock() < ends)}


def set_guide_rate(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x46"""
    axis = motor(values)
    session.shared[f"guide rate {axis}"] = values["rate"]
    yield Start(SetGuideRate(axis, values["rate"] / 256.0))


def guide_rate(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """AUX 0x47 - what was set; half sidereal at first."""
    return {"rate": session.shared.get(f"guide rate {motor(values)}", 128)}


def set_backlash(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x10, 0x11"""
    axis = motor(values)
    session.shared[f"backlash {axis}"] = values["value"]
    yield Start(Backlash(axis, min(99, values["value"])))


def backlash(session: Session, command: Command, values: dict[str, Any]) -> dict[str, int]:
    """AUX 0x40, 0x41"""
    return {"value": session.shared.get(f"backlash {motor(values)}", 0)}


def periodic_error(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """AUX 0x0D"""
    yield Start(PeriodicError(motor(values), bool(values["on"])))


def hibernate(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """x"""
    yield Start(Sleep())


def wake(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """y"""
    yield Start(Wake())


def unsync(session: Session, command: Command, values: dict[str, Any]) -> Handling:
    """u - acknowledged: no mount here keeps a list of syncs."""
    yield GetStatus()
