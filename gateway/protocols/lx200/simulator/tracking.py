"""Tracking rates, alignment modes, park, home and sleep of a simulated Meade, and its accessories.

Focuser, smart drive, backlash, fan, derotator, reticle and GPS power have no effect but their state in ``accessories``.
"""

from __future__ import annotations

from gateway.astro.axes import Build, Pair
from gateway.astro.spherical import SIDEREAL_RATE
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.answers import encode
from gateway.protocols.lx200.simulator.motion import release_keys, slew_axes, unpark
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE

#: Seconds in which an LX200GPS aligns itself.
ALIGN_TIME = 120.0
#: The displayed rate in hertz, and degrees per second.
_DRIVE_RATE_BY_COMMAND = {"TQ": (60.1, SIDEREAL_RATE), "TS": (60.0, SOLAR_RATE), "TL": (57.9, LUNAR_RATE)}
_SIDEREAL_HERTZ = (60.1, 60.2)
_CLASSIC_HZ_RANGE, _OTHER_HZ_RANGE = (56.4, 60.1), (0.0, 99.9)
_PARK_AXES: Pair = (0.0, 0.0)  # north, on the horizon
_POLE_DEGREES = 90.0
_MIN_FOCUS_SPEED, _MAX_FOCUS_SPEED = 1, 4
_ACCESSORY_BY_LETTER = {"f": "fan", "r": "derotator", "g": "gps"}


def _set_drive_rate(sim: MeadeTelescope, hertz: float, rate: float) -> None:
    sim.stored_values["hertz"] = hertz
    sim.mechanics.set_drive_rate(sim.now, rate)


def _use_manual_rate(sim: MeadeTelescope) -> None:
    hertz = sim.stored_values.get("custom", 60.1)
    low, high = _SIDEREAL_HERTZ
    _set_drive_rate(sim, hertz, SIDEREAL_RATE if low <= round(hertz, 1) <= high else hertz / 60.0 * SOLAR_RATE)


def select_drive_rate(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:TQ :TS :TL :TM - select the tracking rate."""
    sim.stored_values["manual"] = command == "TM"
    if command == "TM":
        _use_manual_rate(sim)
    else:
        _set_drive_rate(sim, *_DRIVE_RATE_BY_COMMAND[command])


def set_drive_hertz(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:ST :T - set the tracking rate, hertz: a classic accepts only 56.4 to 60.1, and :ST only in manual mode."""
    low, high = _CLASSIC_HZ_RANGE if sim.classic else _OTHER_HZ_RANGE
    hertz = values["hertz"]
    if not low <= round(hertz, 1) <= high or (sim.classic and command == "ST" and not sim.stored_values.get("manual")):
        return b"0" if command == "ST" else b""
    sim.stored_values["custom"], sim.stored_values["manual"] = hertz, True
    _use_manual_rate(sim)
    return b"1"


def step_drive_hertz(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:T+ :T- - change the manual rate by 0.1 hertz, whether it is in use or not."""
    low, high = _CLASSIC_HZ_RANGE if sim.classic else _OTHER_HZ_RANGE
    hertz = round(sim.stored_values.get("custom", 60.1) + (0.1 if command == "T+" else -0.1), 1)
    sim.stored_values["custom"] = max(low, min(high, hertz))
    if sim.stored_values.get("manual"):
        _use_manual_rate(sim)


def set_alignment_mode(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:AA :AP :AL - set the alignment mode; on a telescope without :GW the alignment is lost."""
    release_keys(sim)
    sim.mode_letter = {"AA": "A", "AP": "P", "AL": "L"}[command]
    if sim.mode_letter != "L" and sim.mechanics.build is not Build.GERMAN:
        sim.mechanics.set_build(sim.now, Build.WEDGE if sim.mode_letter == "P" else Build.ALTAZ)
    sim.parked = False
    sim.track(sim.mode_letter != "L")
    if not sim.supports("GW"):
        sim.mechanics.stop_goto(sim.now)
        sim.lose_alignment()


def auto_align(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:Aa - align automatically; the reply 0 is a refusal outside alt-az mode."""
    if sim.mode_letter != "A":
        return b"0"
    unpark(sim)
    sim.mechanics.stop_goto(sim.now)
    sim.aligned = True
    sim.mechanics.correct(sim.now, (0.0, 0.0))
    sim.track(True)
    return b"1"


# --- park, home, sleep --------------------------------------------------------------------------------------------


def park(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:hP - slew to the horizon in the north, or to the pole; tracking is off."""
    sim.track(False)
    build = sim.mechanics.build
    slew_axes(sim, _PARK_AXES if build is Build.ALTAZ else (sim.power_on_axes(build)[0], _POLE_DEGREES))
    sim.parked = True


def seek_home(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:hS :hF - search for home; until it is found, hardly any command is accepted."""
    unpark(sim)
    slew_axes(sim, sim.power_on_axes(sim.mechanics.build))
    sim.seeks_home, sim.home_state = True, 0


def sleep(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:hN - sleep: the motors are off."""
    release_keys(sim)
    sim.mechanics.stop_goto(sim.now)
    sim.track(False)
    sim.asleep = True


def wake(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:hW - wake from sleep."""
    if sim.asleep:
        sim.asleep = False
        sim.track(sim.mode_letter != "L" and not sim.parked)


def restart(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:I - restart."""
    release_keys(sim)
    sim.mechanics.stop_goto(sim.now)
    sim.power_on()
    return b"X"


# --- accessories --------------------------------------------------------------------------------------------------


def focus(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:F+ :F- :FQ - move the focuser in or out, or stop it."""
    sim.accessories["focuser"] = {"+": 1, "-": -1, "Q": 0}[command[1]]


def set_focus_speed(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:FF :FS :F<n> - select the speed of the focuser."""
    sim.accessories["focus speed"] = {"FF": _MAX_FOCUS_SPEED, "FS": _MIN_FOCUS_SPEED}.get(command) or values["speed"]


def switch_accessory(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:f+ :f- :r+ :r- :g+ :g- - switch an accessory."""
    sim.accessories[_ACCESSORY_BY_LETTER[command[0]]] = command[1] == "+"


def set_backlash(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:$BA :$BZ - store the backlash of the second axis or of the first."""
    sim.accessories[f"backlash {2 if command == '$BA' else 1}"] = values["value"]


def switch_pec(sim: MeadeTelescope, command: str, _: Values) -> None:
    """$Q :$QA :$QZ - turn correction of the periodic error on or off: $Q toggles both axes, the others set one axis."""
    if command == "$Q":
        wanted = not sim.accessories.get("pec 1", False)
        sim.accessories["pec 1"] = sim.accessories["pec 2"] = wanted
    else:
        sim.accessories[f"pec {2 if command[2] == 'A' else 1}"] = command.endswith("+")


def set_reticle(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:B+ :B- :B<n> :BD - set the brightness and the blinking of the reticle."""
    if command in ("B+", "B-"):
        sim.accessories["reticle"] = sim.accessories.get("reticle", 0) + (1 if command == "B+" else -1)
    else:
        sim.accessories["reticle flash" if command == "B" else "reticle duty"] = next(iter(values.values()))


HANDLERS: dict[str, Handler] = {
    "TQ": select_drive_rate, "TS": select_drive_rate, "TL": select_drive_rate, "TM": select_drive_rate,
    "ST": set_drive_hertz, "T": set_drive_hertz, "T+": step_drive_hertz, "T-": step_drive_hertz,
    "AA": set_alignment_mode, "AP": set_alignment_mode, "AL": set_alignment_mode, "Aa": auto_align, "hP": park,
    "hS": seek_home, "hF": seek_home, "hN": sleep, "hW": wake, "I": restart, **dict.fromkeys(("F+", "F-", "FQ"), focus),
    **dict.fromkeys(("FF", "FS", "F"), set_focus_speed),
    **dict.fromkeys(("f+", "f-", "r+", "r-", "g+", "g-"), switch_accessory), "$BA": set_backlash, "$BZ": set_backlash,
    **dict.fromkeys(("$Q", "$QA+", "$QA-", "$QZ+", "$QZ-"), switch_pec),
    **dict.fromkeys(("B+", "B-", "B", "BD"), set_reticle), "fT": lambda sim, name, _: encode(sim, name, value=12.5),
}  # fmt: skip
