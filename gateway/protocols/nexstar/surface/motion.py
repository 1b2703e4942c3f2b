"""Motors: fixed and variable rates, guiding, tracking. Motor directions are passed on as they are, never corrected."""

from __future__ import annotations

from msgspec.structs import replace

from gateway.core import operations as op
from gateway.core.errors import Busy, Invalid, NoAnswer, Unsupported
from gateway.protocols.base.wants import FireAndForget, Handling
from gateway.protocols.nexstar.counting import DRIVE_CODES, key_speed, rate_tables
from gateway.protocols.nexstar.session import NexStarSession, attempt, begin
from gateway.protocols.nexstar.surface.devices import addressed_axis
from gateway.protocols.nexstar.versions import STARSENSE_LONG_MODE, STARSENSE_VARIANT, mode_code, modes_by_code
from gateway.protocols.wireformat.command import Command

_DRIVE_RATE_BY_CODE = {code: name for name, code in DRIVE_CODES.items()}
_MAX_KEY, _MAX_BACKLASH, _MAX_GUIDE_PERCENT = 9, 99, 100
_OFF_OR_ON = (0, 1)


def _axis_and_sense(command: Command) -> tuple[int, int]:
    """Return axis and motor direction of a command by its name: axis 1 and +1 of ``slew_azm_pos``."""
    _, axis, sense = command.name.split("_")
    return (1 if axis == "azm" else 2), (1 if sense == "pos" else -1)


def move_at_key(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """AUX 0x24, 0x25 - move at a hand-control key 1-9; 0 stops the axis. Raises Invalid for a higher number."""
    axis, sense = _axis_and_sense(command)
    if values["rate"] == 0:
        yield FireAndForget(op.StopAxis(axis))
    elif values["rate"] <= _MAX_KEY:
        yield from begin(op.MoveAxis(axis, sense, _rate_of_key(session, values["rate"])))
    else:
        raise Invalid


def _rate_of_key(session: NexStarSession, key: int) -> op.Rate:
    """Return a rate with the key and, for mounts that have no keys, its speed on the presented model."""
    return op.Rate(key=key, degrees=key_speed(rate_tables()[session.model["rates"]], key))


def move_at_rate(command: Command, values: op.Values) -> Handling:
    """AUX 0x06, 0x07 - move at a rate in quarter arcseconds a second; the three highest codes mean tracking rates."""
    axis, sense = _axis_and_sense(command)
    yield from _move_or_track(axis, sense, values["rate"] / 14400.0, _DRIVE_RATE_BY_CODE.get(values["rate"]))


def move_at_fine_rate(command: Command, values: op.Values) -> Handling:
    """Like ``move_at_rate``, but in 1/1024 arcseconds a second and without tracking codes."""
    axis = addressed_axis(values)
    yield from _move_or_track(axis, 1 if command.name.endswith("pos") else -1, values["rate"] / 1024.0 / 3600.0, None)


def _move_or_track(axis: int, sense: int, speed: float, drive_rate: str | None) -> Handling:
    if drive_rate is not None:
        yield from begin(op.TrackRate(name=drive_rate))
    elif speed == 0:
        yield FireAndForget(op.StopAxis(axis))
    else:
        yield from begin(op.MoveAxis(axis, sense, op.Rate(degrees=speed)))


def mode(session: NexStarSession) -> Handling:
    """t - the actual tracking mode: not off if the mount cannot stop tracking. A StarSense 1.20 adds its version."""
    status: op.Status = yield op.GetStatus()
    code = mode_code(status.tracking, session.model, session.model["counts_as"])
    if session.model.get("own") and status.code is not None:
        code = status.code
    if (session.model["variant"], session.model["version"]) == (STARSENSE_VARIANT, STARSENSE_LONG_MODE):
        return bytes((code, *STARSENSE_LONG_MODE)) + b"#"
    return {"mode": code}


def set_mode(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """T - set the tracking mode; ignore an unknown one. A refusal shows only in ``t`` and the log. Raises NoAnswer.
    A SynScan's equatorial modes mean the mount's native mode. If the surface presents the mount itself, not another
    model, the mount gets the client's byte unchanged.
    """
    known = modes_by_code(session.model, session.model["counts_as"])
    if values["mode"] not in known:
        session.refusal_reason = f"{command.help}: there is no mode {values['mode']}"
        return
    wanted = known[values["mode"]]
    code = values["mode"] if session.model.get("own") else None
    yield from attempt(op.SetTracking(on=wanted is not op.Tracking.OFF, mode=wanted, code=code or None))


def pulse(session: NexStarSession, values: op.Values) -> Handling:
    """AUX 0x26 - a guide pulse, percent of sidereal, hundredths of a second. Raises Invalid above 100 percent."""
    axis, ms = addressed_axis(values), values["ticks"] * 10
    if abs(values["rate"]) > _MAX_GUIDE_PERCENT:
        raise Invalid
    if values["rate"] and ms:
        yield from begin(op.PulseAxis(axis, 1 if values["rate"] > 0 else -1, ms, abs(values["rate"]) / 100))
        ends = {**session.shared.pulse_ends, axis: session.clock() + ms / 1000.0}
        session.replace_shared(replace(session.shared, pulse_ends=ends), save=False)


def pulse_active(session: NexStarSession, values: op.Values) -> dict[str, int]:
    """AUX 0x27 - whether the motor's last pulse is still running, whichever client sent it."""
    return {"active": int(session.clock() < session.shared.pulse_ends.get(addressed_axis(values), 0.0))}


def set_guide_rate(session: NexStarSession, values: op.Values) -> Handling:
    """AUX 0x46 - set a motor's guide rate, in 1/256 of sidereal; a mount without it gives the no-response form."""
    axis = addressed_axis(values)
    yield from _apply(session, f"guide rate {axis}", values["rate"], op.SetGuideRate(axis, values["rate"] / 256.0))


def _apply(session: NexStarSession, value_name: str, value: int, operation: op.SetGuideRate | op.Backlash) -> Handling:
    """Set a value on the mount and store it for all clients. Raises Fault; it is stored also after Busy or NoAnswer."""
    try:
        yield operation
    except (Busy, NoAnswer):
        session.replace_shared(session.shared.with_motor_value(value_name, value))
        raise
    session.replace_shared(session.shared.with_motor_value(value_name, value))


def guide_rate(session: NexStarSession, values: op.Values) -> Handling:
    """AUX 0x47 - the mount's guide rate; if it reports none, the last value that was set, at first half sidereal."""
    axis = addressed_axis(values)
    try:
        return {"rate": min(255, round((yield op.GuideRate(axis)) * 256))}
    except Unsupported:
        return {"rate": session.shared.motors.get(f"guide rate {axis}", 128)}


def set_backlash(session: NexStarSession, command: Command, values: op.Values) -> Handling:
    """AUX 0x10, 0x11 - set the antibacklash of one sense of a motor, a Meade's of both. Raises Invalid above 99."""
    axis, value = addressed_axis(values), values["value"]
    if value > _MAX_BACKLASH:
        raise Invalid
    wanted = op.Backlash(axis, value, 1 if command.name.endswith("pos") else -1)
    yield from _apply(session, _backlash_name(command, axis), value, wanted)


def backlash(session: NexStarSession, command: Command, values: op.Values) -> dict[str, int]:
    """AUX 0x40, 0x41 - the backlash compensation of a motor's sense: the last value that was set."""
    return {"value": session.shared.motors.get(_backlash_name(command, addressed_axis(values)), 0)}


def _backlash_name(command: Command, axis: int) -> str:
    return f"backlash {axis} {command.name[-3:]}"


def switch_pec(values: op.Values) -> Handling:
    """AUX 0x0D - turn PEC on or off; a mount without it gives the no-response form. Raises Invalid if not 0 or 1."""
    if values["on"] not in _OFF_OR_ON:
        raise Invalid
    yield op.PeriodicError(addressed_axis(values), bool(values["on"]))


def hibernate_or_wake(command: Command) -> Handling:
    """x, y - hibernate or wake the mount."""
    yield from begin(op.Hibernate() if command.name == "x" else op.Wake())


def ignore_undo_sync() -> None:
    """u - acknowledged without effect: no supported mount keeps a list of syncs."""
