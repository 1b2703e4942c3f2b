"""The motion of a simulated Meade: targets, slews and their refusals, syncs, motion by hand, guiding.

North increases declination or altitude, west turns the first axis with the stars. Rates are degrees per second.
"""

from __future__ import annotations

import math

from gateway.astro.axes import Build, Pair
from gateway.astro.spherical import SIDEREAL_RATE, horizon_to_hour_angle, hour_angle_to_horizon, wrap180, wrap360
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope

#: :RG and :RC in multiples of the sidereal rate, :RM in degrees per second; :RS is the fastest rate.
GUIDE_RATE, CENTER_RATE, FIND_RATE = 1.0, 16.0, 2.0
_BELOW_REPLY_BY_CLASSIC = {True: b"1Object below    horizon.        #", False: b"1Object Below Horizon.#"}
_ABOVE_REPLY_BY_CLASSIC = {True: b"2Object above    higher limit.  #", False: b"2Object Below Higher.#"}
_SIDEREAL_ARCSECONDS = SIDEREAL_RATE * 3600.0  # arcseconds per second


def set_target(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:Sr :Sd :Sa :Sz - set one coordinate of the target."""
    sim.stored_values.update(values)
    return b"1"


def altitude(sim: MeadeTelescope, ra: float, dec: float) -> float:
    """Return the altitude of a position of date at the selected site, degrees."""
    hour_angle = wrap180(sim.mechanics.sky.lst(sim.now) - ra)
    return hour_angle_to_horizon(hour_angle, dec, sim.site[0])[1]


def slew(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:MS - slew to the target."""
    ra, dec = sim.stored_values.get("ra", 0.0), sim.stored_values.get("dec", 0.0)
    return _begin_slew(sim, ra, dec, altitude(sim, ra, dec)) or b"0"


def target_from_horizontal(sim: MeadeTelescope) -> Pair:
    """Return right ascension and declination of the target of :Sz and :Sa."""
    az, alt = (sim.stored_values.get(name, 0.0) for name in ("az", "alt"))
    hour_angle, dec = horizon_to_hour_angle(az, alt, sim.site[0])
    return wrap360(sim.mechanics.sky.lst(sim.now) - hour_angle), dec


def slew_horizontal(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:MA - slew to azimuth and altitude; the reply 1 is a refusal."""
    return b"1" if _begin_slew(sim, *target_from_horizontal(sim), sim.stored_values.get("alt", 0.0)) else b"0"


def _begin_slew(sim: MeadeTelescope, ra: float, dec: float, target_altitude: float) -> bytes | None:
    """Begin a slew, or return the refusal."""
    if target_altitude < sim.stored_values["lowest"] - 1e-3:
        return _BELOW_REPLY_BY_CLASSIC[sim.classic]
    if target_altitude > sim.stored_values["highest"] + 1e-3:
        return _ABOVE_REPLY_BY_CLASSIC[sim.classic]
    unpark(sim)
    sim.goal = (ra, dec), False
    sim.mechanics.goto_sky(sim.now, ra, dec)
    return None


def slew_axes(sim: MeadeTelescope, goal: Pair) -> None:
    """Begin a slew to these axis positions."""
    release_keys(sim)
    sim.goal = goal, True
    sim.mechanics.goto_axes(sim.now, *goal)


def unpark(sim: MeadeTelescope) -> None:
    """Release all direction keys, and unpark the telescope if it is parked."""
    release_keys(sim)
    if sim.parked:
        sim.parked = False
        sim.track(sim.mode_letter != "L")


def sync(sim: MeadeTelescope, command: str, _: Values) -> bytes | None:
    """:CM :CL - sync on the target."""
    sim.mechanics.sync(sim.now, sim.stored_values.get("ra", 0.0), sim.stored_values.get("dec", 0.0))
    sim.aligned = True
    return f"{sim.facts['sync_text']}#".encode() if command == "CM" else None


def select_rate(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:RG :RC :RM :RS - select the rate of motion by hand."""
    sim.stored_values["rate"] = command


def select_key_rate(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:R<n> - select the rate of motion by hand, as number key n of the hand control does."""
    key = values["key"]
    sim.stored_values["rate"] = "RG" if key <= 2 else "RC" if key <= 5 else "RM" if key <= 7 else "RS"


def set_rate(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:RA :RE :Rg - set the rate of :RS, degrees per second, or of :RG, arcseconds per second."""
    sim.stored_values[command] = min(_SIDEREAL_ARCSECONDS, values["rate"]) if command == "Rg" else values["rate"]


def set_max_rate(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:Sw - set the fastest slew rate."""
    low, high = sim.facts["max_rates"]
    if not low <= values["rate"] <= high:
        return b"0"
    sim.mechanics.max_rate = float(values["rate"])
    return b"1"


def _guide_speed(sim: MeadeTelescope) -> float:
    return float(sim.stored_values.get("Rg", GUIDE_RATE * _SIDEREAL_ARCSECONDS)) / 3600.0


def _hand_speed(sim: MeadeTelescope, axis: int) -> float:
    """Return the current rate of motion by hand, degrees per second."""
    name = sim.stored_values["rate"]
    if name == "RG":
        return _guide_speed(sim)
    if name == "RC":
        return CENTER_RATE * SIDEREAL_RATE
    if name == "RM":
        return FIND_RATE
    return float(sim.stored_values.get("RA" if axis == 1 else "RE") or sim.mechanics.max_rate)


def axis_and_sense(sim: MeadeTelescope, letter: str) -> tuple[int, float]:
    """Return the motor and its sense for a direction: north increases declination, west follows the stars."""
    axis, sense = (2 if letter in "ns" else 1), (1.0 if letter in "nw" else -1.0)
    if sim.mechanics.build is not Build.ALTAZ:
        sense *= sim.mechanics.geometry.pole_sign
    if axis == 2 and sim.mechanics.build is Build.GERMAN and sim.mechanics.flipped:
        sense = -sense
    return axis, sense


def press_arrow(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:Mn :Ms :Me :Mw - press a direction key: the guide rate is added to tracking, the other rates replace it."""
    axis, sense = axis_and_sense(sim, command[1])
    if set(sim.arrows) - {axis}:
        release_keys(sim, axis)
    else:
        unpark(sim)
    sim.mechanics.stop_goto(sim.now)
    gentle = sim.stored_values["rate"] == "RG"
    if gentle:
        sim.mechanics.pulse(sim.now, axis, sense * _hand_speed(sim, axis), math.inf)
    else:
        sim.mechanics.move(sim.now, axis, sense * _hand_speed(sim, axis))
    sim.arrows[axis] = gentle


def release_keys(sim: MeadeTelescope, *axes: int) -> None:
    """Release the direction keys of these axes, or all; after the last key the telescope tracks where it points.

    A polar telescope tracks again as soon as the keys of its first axis are released (:Qe halts eastward motion only).
    """
    pressed = [axis for axis in (axes or (1, 2)) if axis in sim.arrows]
    for axis in pressed:
        if sim.arrows.pop(axis):
            sim.mechanics.pulse(sim.now, axis, 0.0, 0.0)
        else:
            sim.mechanics.resume_axis(sim.now, axis)
    if pressed and not sim.arrows:
        sim.mechanics.resume_tracking(sim.now)


def release_arrow(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:Qn :Qs :Qe :Qw - end the motion in a direction."""
    release_keys(sim, axis_and_sense(sim, command[1])[0])


def stop(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:Q - end every motion; computing and waiting for satellites continue."""
    release_keys(sim)
    if sim.mechanics.slewing(sim.now):
        sim.mechanics.stop_goto(sim.now)
        unpark(sim)
    if sim.seeks_home:
        sim.seeks_home, sim.home_state = False, 0


def pulse(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:Mg - a guide pulse."""
    axis, sense = axis_and_sense(sim, values["direction"])
    sim.mechanics.pulse(sim.now, axis, sense * _guide_speed(sim), values["ms"] / 1000.0)


HANDLERS: dict[str, Handler] = {
    "Sr": set_target, "Sd": set_target, "Sa": set_target, "Sz": set_target, "MS": slew, "MA": slew_horizontal,
    "CM": sync, "CL": sync, "RG": select_rate, "RC": select_rate, "RM": select_rate, "RS": select_rate,
    "R": select_key_rate, "RA": set_rate, "RE": set_rate, "Rg": set_rate, "Sw": set_max_rate, "Mn": press_arrow,
    "Ms": press_arrow, "Me": press_arrow, "Mw": press_arrow, "Qn": release_arrow, "Qs": release_arrow,
    "Qe": release_arrow, "Qw": release_arrow, "Q": stop, "Mg": pulse,
}  # fmt: skip
