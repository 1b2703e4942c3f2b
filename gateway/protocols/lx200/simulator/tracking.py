"""What a simulated Meade does when nobody moves it: tracking rates, alignment modes, park, home and sleep."""

from __future__ import annotations

from gateway.astro.axes import Build, Pair
from gateway.astro.spherical import SIDEREAL_RATE
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.motion import release, slew_axes, take_up
from gateway.protocols.lx200.simulator.telescope import Handler, Telescope
from gateway.protocols.mechanics.axis_motor import LUNAR_RATE, SOLAR_RATE

#: Seconds that an LX200GPS takes to align itself.
ALIGNING = 120.0
#: Hertz as shown, and degrees a second.
_DRIVES = {"TQ": (60.1, SIDEREAL_RATE), "TS": (60.0, SOLAR_RATE), "TL": (57.9, LUNAR_RATE)}
_SIDEREAL_HERTZ = (60.1, 60.2)
_CLASSIC_HERTZ, _ANY_HERTZ = (56.4, 60.1), (0.0, 99.9)
_LEVEL: Pair = (0.0, 0.0)  # north, on the horizon
_POLE = 90.0


def _drive(sim: Telescope, hertz: float, rate: float) -> None:
    sim.kept["hertz"] = hertz
    sim.mechanics.keep_up_with(sim.now, rate)


def _drive_manually(sim: Telescope) -> None:
    hertz = sim.kept.get("custom", 60.1)
    low, high = _SIDEREAL_HERTZ
    _drive(sim, hertz, SIDEREAL_RATE if low <= round(hertz, 1) <= high else hertz / 60.0 * SOLAR_RATE)


def drive(sim: Telescope, name: str, _: Values) -> None:
    """:TQ :TS :TL :TM"""
    sim.kept["manual"] = name == "TM"
    if name == "TM":
        _drive_manually(sim)
    else:
        _drive(sim, *_DRIVES[name])


def set_drive(sim: Telescope, name: str, values: Values) -> bytes:
    """:ST :T - a classic takes 56.4 to 60.1 only, and :ST only in manual mode."""
    low, high = _CLASSIC_HERTZ if sim.classic else _ANY_HERTZ
    hertz = values["hertz"]
    if not low <= round(hertz, 1) <= high or (sim.classic and name == "ST" and not sim.kept.get("manual")):
        return b"0" if name == "ST" else b""
    sim.kept["custom"], sim.kept["manual"] = hertz, True
    _drive_manually(sim)
    return b"1"


def step_drive(sim: Telescope, name: str, _: Values) -> None:
    """:T+ :T- - the manual rate, in use or not."""
    low, high = _CLASSIC_HERTZ if sim.classic else _ANY_HERTZ
    hertz = round(sim.kept.get("custom", 60.1) + (0.1 if name == "T+" else -0.1), 1)
    sim.kept["custom"] = max(low, min(high, hertz))
    if sim.kept.get("manual"):
        _drive_manually(sim)


def align(sim: Telescope, name: str, _: Values) -> None:
    """:AA :AP :AL - where :GW is not known, the alignment begins anew: what was learnt before is gone."""
    release(sim)
    sim.letter = {"AA": "A", "AP": "P", "AL": "L"}[name]
    if sim.letter != "L" and sim.mechanics.build is not Build.GERMAN:
        sim.mechanics.rebuild(sim.now, Build.WEDGE if sim.letter == "P" else Build.ALTAZ)
    sim.parked = False
    sim.track(sim.letter != "L")
    if not sim.knows("GW"):
        sim.mechanics.cancel(sim.now)
        sim.forget()


def auto_align(sim: Telescope, name: str, _: Values) -> bytes:
    """:Aa"""
    if sim.letter != "A":
        return b"0"
    take_up(sim)
    sim.mechanics.cancel(sim.now)
    sim.aligned = True
    sim.mechanics.correct(sim.now, (0.0, 0.0))
    sim.track(True)
    return b"1"


# --- park, home, sleep --------------------------------------------------------------------------------------------


def park(sim: Telescope, name: str, _: Values) -> None:
    """:hP - level and north, or the pole; then the motors are off."""
    sim.track(False)
    build = sim.mechanics.build
    slew_axes(sim, _LEVEL if build is Build.ALTAZ else (sim.start(build)[0], _POLE))
    sim.parked = True


def seek_home(sim: Telescope, name: str, _: Values) -> None:
    """:hS :hF - until it is found, hardly anything is heard."""
    take_up(sim)
    slew_axes(sim, sim.start(sim.mechanics.build))
    sim.seeking, sim.home = True, 0


def sleep(sim: Telescope, name: str, _: Values) -> None:
    """:hN - motors off."""
    release(sim)
    sim.mechanics.cancel(sim.now)
    sim.track(False)
    sim.asleep = True


def wake(sim: Telescope, name: str, _: Values) -> None:
    """:hW"""
    if sim.asleep:
        sim.asleep = False
        sim.track(sim.letter != "L" and not sim.parked)


def restart(sim: Telescope, name: str, _: Values) -> bytes:
    """:I"""
    release(sim)
    sim.mechanics.cancel(sim.now)
    sim.power_on()
    return b"X"


HANDLERS: dict[str, Handler] = {
    "TQ": drive, "TS": drive, "TL": drive, "TM": drive, "ST": set_drive, "T": set_drive, "T+": step_drive,
    "T-": step_drive, "AA": align, "AP": align, "AL": align, "Aa": auto_align, "hP": park, "hS": seek_home,
    "hF": seek_home, "hN": sleep, "hW": wake, "I": restart,
}  # fmt: skip
