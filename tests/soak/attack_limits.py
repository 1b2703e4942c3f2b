"""Attacks on the limits: wrong sites and clocks, syncs, and ways to move that a limit may have forgotten.

Each has a name, the mounts it is tried on, a script, and the figure by which it is judged with its permitted range: the
limit, and how far a mount coasts beyond it.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from functools import partial

from msgspec import Struct

from gateway.astro.axes import Observer
from gateway.astro.spherical import hour_angle_to_horizon, wrap180
from tests.soak.attacked import EVENING, NOON, SITE, Attacked, Program

Script = Callable[[Attacked], dict[str, float] | None]
LOWEST, NEAR_SUN = 10.0, 20.0
#: Degrees that altitudes and the Sun's distance may fall short: rounding, refraction, and coasting of the mount.
RUNS_ON = 0.3
ALTITUDE, SUN = ("altitude", LOWEST - RUNS_ON, None), ("sun", NEAR_SUN - RUNS_ON, None)
FORK, GERMAN, MEADE, AUTOSTAR = "nexstar:cpc/4.21", "nexstar:cge/4.21", "lx200:lx200gps", "lx200:autostar"


class Attack(Struct, frozen=True):
    """``judged``: the figure's name, its minimum and its maximum; ``options`` are command-line options of the gateway.

    ``settled``: seconds that the gateway has to get to know the mount.
    """

    group: str
    name: str
    mounts: tuple[str, ...]
    script: Script
    judged: tuple[str, float | None, float | None]
    options: tuple[str, ...] = ("--lowest", "10")
    surface: str = "lx200:lx200gps"
    start: str = EVENING
    host: str = ""
    sim: tuple[str, ...] = ()
    settled: float = 2.0
    site: tuple[float, float] = SITE


def goto(program: Program, ra: float, dec: float) -> bool:
    """Send a goto; return whether the LX200 surface accepted it."""
    hours, sign = ra / 15.0 % 24.0, "-" if dec < 0 else "+"
    seconds, arcseconds = round(hours * 3600) % 86400, round(abs(dec) * 3600)
    target = (
        f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#"
        f":Sd{sign}{arcseconds // 3600:02}*{arcseconds // 60 % 60:02}:{arcseconds % 60:02}#"
    )
    heard = program.ask(target.encode(), 2.0, until=b"11")
    return heard == b"11" and program.ask(b":MS#", 8.0, until=b"0") == b"0"


def told_position(program: Program) -> tuple[float, float]:
    """Return right ascension and declination as the LX200 surface reports them, degrees, to arcseconds."""
    hours = program.ask(b":GR#").rstrip(b"#").decode("latin-1")
    degrees = program.ask(b":GD#").rstrip(b"#").decode("latin-1")
    first, second, third = (float(part) for part in hours.split(":"))
    whole, minutes, seconds = (float(part) for part in re.split(r"\D", degrees[1:]))
    sign = -1.0 if degrees[0] == "-" else 1.0
    return (first + second / 60.0 + third / 3600.0) * 15.0, sign * (whole + minutes / 60.0 + seconds / 3600.0)


def angle(degrees: float) -> bytes:
    """Return an angle as eight digits of the NexStar protocol."""
    return b"%08X" % (round(degrees % 360.0 / 360.0 * (1 << 32)) & 0xFFFFFF00)


# --- sites and clocks of any program ----------------------------------------------------------------------------------

HOUR = 3600.0
#: What a program sends -> the site and clock that follow if it is accepted. The evening is at 22:00 UTC.
EVENING_LIES = {
    "latitude 10 N": (b":St+10*00#", Observer(10.0, 10.0)),
    "longitude with the wrong sign": (b":Sg010*00#", Observer(45.0, -10.0)),
    "Greenwich": (b":St+51*28#:Sg000*00#", Observer(51.47, 0.0)),
    "latitude and longitude swapped": (b":St+10*00#:Sg315*00#", Observer(10.0, 45.0)),
    "longitude 72 W": (b":Sg071*45#", Observer(45.0, -71.75)),
    "AM for PM": (b":SG+00#:SL10:00:00#:SC01/15/26#", Observer(45.0, 10.0, -12 * HOUR)),
    "zone with the wrong sign": (b":SG+01#:SL23:00:00#:SC01/15/26#", Observer(45.0, 10.0, 2 * HOUR)),
    "3 h slow": (b":SG+00#:SL19:00:00#:SC01/15/26#", Observer(45.0, 10.0, -3 * HOUR)),
}  # fmt: skip
NEXSTAR_LIES = {
    "NexStar H, 3 h slow": (b"H\x13\x00\x00\x01\x0f\x1a\x00\x00", Observer(45.0, 10.0, -3 * HOUR)),
    "NexStar W, 40 W": (b"W\x2d\x00\x00\x00\x28\x00\x00\x01", Observer(45.0, -40.0)),
}
#: At noon on 21 June, 11:00 UTC.
NOON_LIES = {
    "AM for PM": b":SG+00#:SL23:00:00#:SC06/21/26#",
    "longitude 172 W": b":Sg171*45#",
    "half a year old": b":SG+00#:SL23:59:00#:SC12/21/26#",
    "8 h fast": b":SG+00#:SL19:30:00#",
    "a clock of 1970": b":SG+00#:SL00:00:10#:SC01/01/70#",
}


def below_the_limit(said: bytes, believed: Observer, at: Attacked) -> None:
    program = at.program()
    program.ask(said, 3.0, until=b"\0")
    at.begin()
    if goto(program, *at.looks_highest(3.0, believed)):
        at.rests(30.0)


def below_the_limit_by_nexstar(said: bytes, believed: Observer, at: Attacked) -> None:
    program = at.program()
    program.ask(said, 2.0)
    at.begin()
    ra, dec = at.looks_highest(3.0, believed)
    program.ask(b"r" + angle(ra) + b"," + angle(dec), 4.0)
    at.rests(30.0)


def arrow_down(said: bytes, at: Attacked) -> None:
    program = at.program()
    program.ask(said, 3.0, until=b"\0")
    at.begin()
    program.tell(b":RS#:Ms#")
    program.poll(24.0)


def near_the_sun(said: bytes, at: Attacked) -> None:
    program = at.program()
    program.ask(said, 3.0, until=b"\0")
    at.begin()
    if goto(program, *at.beside_the_sun(2.0)):
        at.rests(30.0)


ALL = (FORK, GERMAN, MEADE)
LIES = [
    *(Attack("site and clock", f"{name}, goto to 3° altitude", ALL, partial(below_the_limit, *lie), ALTITUDE)
      for name, lie in EVENING_LIES.items()),
    *(Attack("site and clock", f"{name}, goto to 3° altitude", (FORK, GERMAN),
             partial(below_the_limit_by_nexstar, *lie), ALTITUDE, surface="nexstar:cge/4.21")
      for name, lie in NEXSTAR_LIES.items()),
    *(Attack("site and clock", f"{name}, goto to 3° altitude in the first moment", (FORK, GERMAN),
             partial(below_the_limit_by_nexstar, *lie), ALTITUDE, surface="nexstar:cge/4.21",
             sim=("--latency", "0.1"), settled=0.0) for name, lie in NEXSTAR_LIES.items()),
    *(Attack("site and clock", f"{name}, arrow down", ALL, partial(arrow_down, EVENING_LIES[name][0]), ALTITUDE)
      for name in ("latitude 10 N", "AM for PM")),
    *(Attack("site and clock", f"{name}, goto to 2° from the Sun", (FORK, GERMAN, AUTOSTAR),
             partial(near_the_sun, said), SUN, ("--lowest", "-90"), start=NOON) for name, said in NOON_LIES.items()),
    Attack("site and clock", "this computer's clock of 1970, goto to 2° from the Sun", (FORK, "nexstar:gt/101.0"),
           partial(near_the_sun, b""), SUN, ("--site", "45,10"), start=NOON, host="1970-01-01T00:00:10+00:00"),
    Attack("site and clock", "this computer's clock of 1970, goto to 3° altitude", (FORK, GERMAN),
           partial(below_the_limit, b"", Observer(45.0, 10.0, -1768514400.0)), ALTITUDE,
           host="1970-01-01T00:00:10+00:00"),
]  # fmt: skip

# --- syncs, and orders to a mount that does not know where it points --------------------------------------------------


def syncs_add_up(at: Attacked) -> None:
    """Sync four times to 14 degrees above the reported position, then move down by direction key."""
    program = at.program()
    at.begin()
    for _ in range(4):
        told = told_position(program)
        hour_angle = wrap180(at.sky().sidereal(at.now) - told[0])
        azimuth, altitude = hour_angle_to_horizon(hour_angle, told[1], SITE[0])
        ra, dec = at.place(azimuth, min(89.0, altitude + 14.0))
        seconds, arcminutes = round(ra / 15.0 * 3600) % 86400, round(abs(dec) * 60)
        target = (
            f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#"
            f":Sd{'-' if dec < 0 else '+'}{arcminutes // 60:02}*{arcminutes % 60:02}:00#"
        )
        program.ask(target.encode(), 2.0, until=b"11")
        program.ask(b":CM#", 4.0)
        time.sleep(0.5)
    program.tell(b":RS#:Ms#")
    program.poll(15.0)


def unaligned(order: bytes, at: Attacked) -> None:
    program = at.program()
    at.begin()
    program.ask(order, 4.0, until=b"\0")
    at.rests(25.0)


#: Degrees that a mount which does not know where it points may be turned without its owner's permission.
STAYS = ("turned", None, 0.5)
SYNCS = [
    Attack("syncs", "four syncs of 14°, then an arrow down", (FORK, GERMAN, MEADE, AUTOSTAR), syncs_add_up, ALTITUDE),
    Attack("not aligned", "`:Sz090*00#:Sa+30*00#:MA#`", (FORK,), partial(unaligned, b":Sz090*00#:Sa+30*00#:MA#"), STAYS,
           sim=("--unaligned",)),
    Attack("not aligned", "`:hP#`", (FORK,), partial(unaligned, b":hP#"), STAYS, sim=("--unaligned",)),
    Attack("not aligned", "NexStar `b`", (FORK,), partial(unaligned, b"b" + angle(90.0) + b"," + angle(30.0)), STAYS,
           surface="nexstar:cge/4.21", sim=("--unaligned",)),
    Attack("not aligned", "AUX goto of one axis", (FORK,), partial(unaligned, b"P\x04\x10\x02\x40\x00\x00\x00"), STAYS,
           surface="nexstar:cge/4.21", sim=("--unaligned",)),
]  # fmt: skip

# --- the meridian -----------------------------------------------------------------------------------------------------

#: Degrees past the meridian: half an hour, and how far a mount coasts after a direction key.
PAST = ("past meridian", None, 7.5 + 2.0)
_HALF_AN_HOUR = ("--hour-angle-limit", "0.5")


def past_the_meridian(order: bytes, at: Attacked) -> None:
    program = at.program()
    at.begin()
    program.ask(order, 4.0)
    at.rests(40.0)


def arrow_past_the_meridian(at: Attacked) -> None:
    program = at.program()
    goto(program, at.at_hour_angle(-30.0), 20.0)
    at.rests(40.0)
    at.begin()
    program.tell(b":RS#:Mw#")
    program.poll(14.0)


def tracking_past_the_meridian(at: Attacked) -> None:
    """Move by direction key to just before the limit, then wait."""
    program = at.program()
    goto(program, at.at_hour_angle(-10.0), 20.0)
    at.rests(40.0)
    at.begin()
    program.tell(b":RM#:Mw#")
    end = time.monotonic() + 20.0
    while at.here["past_meridian"] < 6.0 and time.monotonic() < end:
        time.sleep(0.05)
    program.tell(b":Qw#")
    time.sleep(2.0)
    program.tell(b":RC#:Mw#")
    while at.here["past_meridian"] < 7.3 and time.monotonic() < end + 30.0:
        time.sleep(0.05)
    program.tell(b":Qw#")
    program.poll(90.0)


MERIDIAN = [
    Attack("meridian", "NexStar `b` to 340°, 40°", (GERMAN,), partial(past_the_meridian, b"b" + angle(340.0) + b"," +
           angle(40.0)), PAST, _HALF_AN_HOUR, "nexstar:cge/4.21"),
    Attack("meridian", "AUX goto of one axis to 330°", (GERMAN,), partial(past_the_meridian,
           b"P\x04\x10\x02\xea\xaa\xaa\x00"), PAST, _HALF_AN_HOUR, "nexstar:cge/4.21"),
    Attack("meridian", "arrow", (GERMAN,), arrow_past_the_meridian, PAST, _HALF_AN_HOUR),
    Attack("meridian", "tracking", (GERMAN,), tracking_past_the_meridian, ("past meridian", None, 7.6), _HALF_AN_HOUR),
]  # fmt: skip

# --- the horizon, by park, tracking and pulses ------------------------------------------------------------------------


def park(at: Attacked) -> None:
    program = at.program()
    at.begin()
    program.tell(b":hP#")
    at.rests(35.0)


def sinks(order: bytes, at: Attacked) -> None:
    """Track a star in the west down to the limit, giving the same order again and again."""
    program = at.program()
    goto(program, *at.place(268.0, 10.06))
    at.rests(40.0)
    at.begin()
    for _ in range(14):
        program.poll(5.0)
        program.ask(order, 0.5)


#: Degrees: the gateway turns tracking off at the limit; what the tube sinks afterwards is counted in hundredths.
AT_LIMIT = ("altitude", LOWEST - 0.05, None)
HORIZON = [
    Attack("horizon", "`:hP#`", (FORK, AUTOSTAR, MEADE), park, ALTITUDE),
    Attack("horizon", "tracking put on again, `:AA#`", (FORK,), partial(sinks, b":AA#"), AT_LIMIT),
    Attack("horizon", "pulses down, `:Mgs2500#`", ("nexstar:evolution/5.31",), partial(sinks, b":Mgs2500#"), AT_LIMIT),
]  # fmt: skip

LIMITS = [*LIES, *SYNCS, *MERIDIAN, *HORIZON]
