"""The devices behind the hand control's pass-through command: the two motors, a focuser and a GPS receiver.

A handler returns the values of its reply, or None if the device does not have the command; the hand control then uses
its no-response form. The rates of keys 1-9 come from ``rates.toml``; the simulator's ``speed`` applies only to gotos.
"""

from __future__ import annotations

from collections.abc import Callable

from gateway.astro.spherical import SIDEREAL_RATE, wrap180
from gateway.core.operations import Values
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE
from gateway.protocols.nexstar.simulator.mount import ALT, AZM, FOCUSER, GPS, RTC, Handler, SimulatedMount
from gateway.protocols.wireformat.rows import Version

#: Variable rates that are codes, not speeds: sidereal, solar and lunar tracking of the motor.
DRIVE_RATE_BY_CODE = {0xFFFF: SIDEREAL_RATE, 0xFFFE: SOLAR_RATE, 0xFFFD: LUNAR_RATE}
#: The keys that do not override equatorial tracking (NexStar protocol, Slewing Commands, note).
GENTLE_KEYS = (1, 2)
#: The first motor firmware with guide pulses.
PULSE_FIRMWARE = (6, 12)
#: The first motor firmware that reports its model, and the first with cord wrap prevention.
MODEL_FIRMWARE, CORDWRAP_FIRMWARE = (7, 0), (5, 0)
HOME_DEGREES = 90.0  # where the home switches of both axes are
MAX_BACKLASH = 99
VERSION_BY_DEVICE: dict[int, Version] = {GPS: (1, 6), RTC: (1, 2), FOCUSER: (7, 16)}
_TURN = 1 << 24
"""Steps in one turn of a motor; a focuser counts plain steps in the same field."""


# --- hand rates -----------------------------------------------------------------------------------------


def _move_at_key(sim: SimulatedMount, values: Values, sign: int) -> Values | None:
    """24 and 25 hex: hand motion at a key from 1 to 9; 0 stops."""
    key, device = values["rate"], values["device"]
    if key > len(sim.key_speeds):
        return {}
    if device == FOCUSER and sim.focuser is not None:
        end = sim.focuser.TRAVEL_STEPS if sign > 0 else 0
        sim.focuser.move_to(sim.now, end, sim.focuser.MAX_RATE * 2.0 ** (key - 9) if key else 0.0)
        return {}
    if device not in (AZM, ALT):
        return None
    rate = sim.key_speeds[key - 1] if key else 0.0
    if sim.goto is not None and (key or not (left := sim.goto.axes_not_stopped - {device - 15})):
        sim.goto = None  # it does not restart
    elif sim.goto is not None and sim.goto.cancelled_at <= sim.now:
        sim.goto.axes_not_stopped = left
    sim.mechanics.move(sim.now, device - 15, sign * rate, additive=key in GENTLE_KEYS)
    return {}


def _move_at_rate(sim: SimulatedMount, values: Values, sign: int) -> Values:
    """06 and 07 hex: a rate in quarter arcseconds a second, or a code for a drive rate."""
    drive = DRIVE_RATE_BY_CODE.get(values["rate"])
    rate = values["rate"] / 14400.0 if drive is None else drive
    sim.mechanics.set_rate(sim.now, values["device"] - 15, sign * rate, is_drive_rate=drive is not None)
    return {}


def _move_at_fine_rate(sim: SimulatedMount, values: Values, sign: int) -> Values:
    """06 and 07 hex with three bytes: a rate in 1/1024 arcsecond a second."""
    sim.mechanics.set_rate(sim.now, values["device"] - 15, sign * values["rate"] / 1024.0 / 3600.0)
    return {}


def _pulse(sim: SimulatedMount, values: Values) -> Values:
    """26 hex: a guide pulse, in percent of sidereal and hundredths of a second."""
    rate = max(-100, min(100, values["rate"])) / 100.0 * SIDEREAL_RATE
    sim.mechanics.pulse(sim.now, values["device"] - 15, rate, values["ticks"] / 100.0)
    return {}


# --- positions ------------------------------------------------------------------------------------------


def _position(sim: SimulatedMount, values: Values) -> Values | None:
    device = values["device"]
    if device == FOCUSER and sim.focuser is not None:
        return {"position": round(sim.focuser.position(sim.now)) * 360.0 / _TURN}
    return {"position": sim.encoders()[device - 16]} if device in (AZM, ALT) else None


def _goto(sim: SimulatedMount, values: Values, slow: bool) -> Values | None:
    """02 and 17 hex: goto of a single motor, or of the focuser."""
    device = values["device"]
    if device == FOCUSER and sim.focuser is not None:
        sim.focuser.move_to(sim.now, values["position"] / 360.0 * _TURN)
        return {}
    if device not in (AZM, ALT):
        return None
    position = values["position"] - sim.encoder_offset[device - 16]
    sim.mechanics.goto_axis(sim.now, device - 15, position, slow)
    return {}


def _has_arrived(sim: SimulatedMount, values: Values) -> Values | None:
    """13 and 12 hex: 255 if the motor has arrived, else 0."""
    device = values["device"]
    if device == FOCUSER and sim.focuser is not None:
        return {"done": 0 if sim.focuser.is_moving(sim.now) else 255}
    if device not in (AZM, ALT):
        return None
    return {"done": 0 if sim.mechanics.slewing(sim.now, device - 15) else 255}


def _set_position(sim: SimulatedMount, values: Values) -> Values | None:
    """04 hex: set the motor's count. The hand control takes the new count for the true position."""
    axis = values["device"] - 16
    change = wrap180(values["position"] - sim.encoders()[axis])
    sim.encoder_offset[axis] += change
    believed = list(sim.mechanics.sync_correction)
    believed[axis] = wrap180(believed[axis] + change)
    sim.mechanics.correct(sim.now, (believed[0], believed[1]))
    return {}


def _seek_home(sim: SimulatedMount, values: Values) -> Values:
    sim.mechanics.goto_axis(sim.now, values["device"] - 15, HOME_DEGREES)
    return {}


# --- settings -------------------------------------------------------------------------------------------


def _make_setter(setting: str, max_value: int) -> Handler:
    """Return a handler that stores a motor setting; a value beyond the limit is acknowledged and ignored."""

    def set_value(sim: SimulatedMount, values: Values) -> Values:
        field = "rate" if "rate" in values else "value"
        if values[field] <= max_value:
            sim.settings[setting, values["device"]] = values[field]
        return {}

    return set_value


def _make_reader(setting: str, default: int) -> Handler:
    def read_value(sim: SimulatedMount, values: Values) -> Values:
        value = sim.settings.get((setting, values["device"]), default)
        return {"rate": value, "value": value}

    return read_value


def _switch_pec(sim: SimulatedMount, values: Values) -> Values | None:
    """0C and 0D hex: acknowledged and stored; the simulated gears have no error to correct."""
    if values["device"] != AZM:
        return None
    sim.settings["periodic error", AZM] = int(bool(values.get("on", 0)))
    return {}


def _make_fixed_reader(value: int) -> Handler:
    """Return a handler that always reports the same value."""
    return lambda sim, values: dict.fromkeys(("value", "done", "on", "other"), value)


def _motors_only(handler: Handler, *, min_firmware: Version = (), part: str = "") -> Handler:
    """Wrap a handler: the wrapper returns None for other devices, older firmware, and mounts without ``part``."""

    def restricted(sim: SimulatedMount, values: Values) -> Values | None:
        fits = (
            values["device"] in (AZM, ALT) and sim.firmware >= min_firmware and (not part or part in sim.facts["has"])
        )
        return handler(sim, values) if fits else None

    return restricted


def _version(sim: SimulatedMount, values: Values) -> Values | None:
    """FE hex: the firmware version; the build number, only in a reply of four bytes, is 0."""
    device = values["device"]
    major, minor = sim.firmware if device in (AZM, ALT) else VERSION_BY_DEVICE[device]
    return {"major": major, "minor": minor, "build": 0}


def _both_directions(
    prefix: str, handler: Callable[[SimulatedMount, Values, int], Values | None]
) -> dict[str, Handler]:
    """Return the handlers of two commands that differ only in direction: ``handler`` with +1 and with -1."""
    return {
        f"{prefix}_pos": lambda sim, values: handler(sim, values, +1),
        f"{prefix}_neg": lambda sim, values: handler(sim, values, -1),
    }


HANDLER_BY_REQUEST: dict[str, Handler] = {
    **_both_directions("slew_azm", _move_at_key),
    **_both_directions("slew_alt", _move_at_key),
    **_both_directions("move", _move_at_key),
    **_both_directions("rate_azm", _move_at_rate),
    **_both_directions("rate_alt", _move_at_rate),
    **{name: _motors_only(handler) for name, handler in _both_directions("fine_rate", _move_at_fine_rate).items()},
    "pulse": _motors_only(_pulse, min_firmware=PULSE_FIRMWARE),
    "pulse_active": _motors_only(
        lambda sim, values: {"active": int(sim.mechanics.pulsing(sim.now, values["device"] - 15))},
        min_firmware=PULSE_FIRMWARE,
    ),
    "axis_set_position": _motors_only(_set_position),
    "axis_position": _position,
    "axis_goto": lambda sim, values: _goto(sim, values, slow=False),
    "axis_goto_slow": lambda sim, values: _goto(sim, values, slow=True),
    "axis_done": _has_arrived,
    "level_start": _motors_only(_seek_home, part="home"),
    "level_done": _motors_only(_has_arrived, part="home"),
    "set_guide_rate": _motors_only(_make_setter("guide rate", 255)),
    "guide_rate": _motors_only(_make_reader("guide rate", 128)),
    "set_backlash_pos": _motors_only(_make_setter("positive backlash", MAX_BACKLASH)),
    "set_backlash_neg": _motors_only(_make_setter("negative backlash", MAX_BACKLASH)),
    "backlash_pos": _motors_only(_make_reader("positive backlash", 0)),
    "backlash_neg": _motors_only(_make_reader("negative backlash", 0)),
    "motor_model": _motors_only(lambda sim, values: {"value": sim.facts["id"]}, min_firmware=MODEL_FIRMWARE),
    "pec_record": _motors_only(_switch_pec, part="pec"),
    "pec_playback": _motors_only(_switch_pec, part="pec"),
    "pec_bin": _motors_only(_make_fixed_reader(0), part="pec"),
    "pec_recorded": _motors_only(_make_fixed_reader(0), part="pec"),
    "at_index": _motors_only(_make_fixed_reader(255), part="pec"),
    "max_rate_on": _motors_only(_make_fixed_reader(0)),
    "max_rate": lambda sim, values: None,
    "cordwrap": _motors_only(_make_fixed_reader(255), min_firmware=CORDWRAP_FIRMWARE),
    # only the azimuth motor winds cords up
    "cordwrap_position": _motors_only(
        lambda sim, values: {"position": 180.0} if values["device"] == AZM else None, min_firmware=CORDWRAP_FIRMWARE
    ),
    "approach": _motors_only(_make_fixed_reader(1)),
    "gps_satellites": lambda sim, values: {"visible": 9, "tracked": 7},
    "gps_receiver": lambda sim, values: {"value": 0x0800},
    "gps_hardware": lambda sim, values: {"value": 1},
    "device_version": _version,
    "long_version": _version,
}
