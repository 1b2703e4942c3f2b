"""Attacks by settings: a clock or site that overtakes a goto, and those of one program that spoil another's.

The first are tried on the Meades, which take what programs set: forks in alt-az and on a wedge, in both hemispheres.
The second on Celestrons that keep their own: alt-az, on a wedge, German.
"""

from __future__ import annotations

import time
from functools import partial

from gateway.astro.spherical import separation
from tests.soak.attack_limits import AUTOSTAR, FORK, GERMAN, MEADE, RUNS_ON, Attack, goto
from tests.soak.attacked import EVENING, NOON, SITE, Attacked, Program

LOWEST, SOUTH = 20.0, (-33.0, 10.0)
ALTITUDE = ("altitude", LOWEST - RUNS_ON, None)
LIMITED = ("--lowest", f"{LOWEST:g}", "--sun", "0")


def as_target(ra: float, dec: float) -> bytes:
    seconds, arcseconds = round(ra / 15.0 * 3600) % 86400, round(abs(dec) * 3600)
    sign = b"-" if dec < 0 else b"+"
    return b":Sr%02d:%02d:%02d#:Sd%s%02d*%02d:%02d#" % (
        seconds // 3600, seconds // 60 % 60, seconds % 60,
        sign, arcseconds // 3600, arcseconds // 60 % 60, arcseconds % 60,
    )  # fmt: skip


# --- a clock or site together with a goto -----------------------------------------------------------------------------

#: What is set, by which an object in the east stands lower than it does.
SLOW, SLOW_DATED = b":SL18:30:00#", b":SG+00#:SL18:30:00#:SC01/15/26#"
WEST, ELSEWHERE = b":Sg040*00#", b":St+10*00#:Sg060*00#"


def overtakes(before: bytes, after: bytes, pause: float, polar: bool, at: Attacked) -> None:
    """Send ``before`` and a goto to 25 degrees in the east in one packet, and ``after`` some seconds later."""
    program = at.program()
    if polar:
        program.tell(b":AP#")
        time.sleep(1.0)
    target = as_target(*at.place(100.0 if at.site[0] > 0 else 80.0, 25.0))
    at.begin()
    program.tell(before + target + b":MS#")
    time.sleep(pause)
    if after:
        program.tell(after)
    at.rests(30.0)
    program.poll(3.0)


TOGETHER = {
    "a time of day and a goto in one packet": (SLOW, b"", 0.0),
    "a time twice and a goto in one packet": (SLOW + SLOW, b"", 0.0),
    "time, date and zone and a goto in one packet": (SLOW_DATED, b"", 0.0),
    "half a site and a goto in one packet": (WEST, b"", 0.0),
    "a site and a goto in one packet": (ELSEWHERE, b"", 0.0),
    "a time of day 0.6 s after a goto": (b"", SLOW, 0.6),
    "time, date and zone 0.6 s after a goto": (b"", SLOW_DATED, 0.6),
    "half a site 0.6 s after a goto": (b"", WEST, 0.6),
}
OVERTAKING = [
    *(Attack("settings and gotos", f"{name}{', on a wedge' * polar}{', south' * (site is SOUTH)}", (MEADE, AUTOSTAR),
             partial(overtakes, before, after, pause, polar), ALTITUDE, LIMITED, start=start, site=site)
      for name, (before, after, pause) in TOGETHER.items()
      for polar, site, start in ((False, SITE, EVENING),)),
    *(Attack("settings and gotos", f"{name}{', on a wedge' * polar}{', south' * (site is SOUTH)}", (MEADE,),
             partial(overtakes, *TOGETHER[name], polar), ALTITUDE, LIMITED, site=site)
      for name in ("a time of day and a goto in one packet", "a time of day 0.6 s after a goto")
      for polar, site in ((True, SITE), (False, SOUTH), (True, SOUTH))),
]  # fmt: skip

# --- one program among others -----------------------------------------------------------------------------------------

#: What one program gets wrong about site and time.
LIES = {
    "10 N 120 W": b":St+10*00#:Sg120*30#",
    "Sydney": b":St-33*52#:Sg208*48#:SG-10#",
    "a clock 40 days off": b":SG+03#:SL12:00:00#:SC02/27/26#",
    "AM for PM": b":SG+00#:SL10:00:00#:SC01/15/26#",
}


def prepared(wedge: bool, lie: bytes, restarts: bool, at: Attacked) -> Program:
    """One program lies, from an address of its own; return another one."""
    if wedge and not at.http:  # it is on its wedge from the start
        at.owner().ask(b"T\x02" if at.site[0] > 0 else b"T\x03")
        time.sleep(6.0)
    liar = at.program("127.0.0.2")
    liar.ask(lie, 3.0, until=b"\0")
    time.sleep(1.0)
    if restarts:
        at.restart()
        time.sleep(3.0)
    return at.program("127.0.0.3")


def spoils_gotos(
    wedge: bool, lie: bytes, restarts: bool, at: Attacked, azimuth: float = 60.0, altitude: float = 50.0
) -> dict[str, float]:
    """The other program goes to a place that is truly up, and not near the Sun: how far from it does the tube end?"""
    program = prepared(wedge, lie, restarts, at)
    at.begin()
    goal = at.place(azimuth, altitude)
    goto(program, *goal)
    at.rests(40.0)
    return {"off": at.off(*goal)}


def spoils_readings(wedge: bool, lie: bytes, restarts: bool, at: Attacked) -> dict[str, float]:
    """The other program reads the site: by how much is it wrong?"""
    program = prepared(wedge, lie, restarts, at)
    at.begin()

    def degrees(question: bytes) -> float:
        text = program.ask(question).rstrip(b"#").decode("latin-1")
        whole, minutes = (float(part) for part in text.replace("\xdf", "*").lstrip("+-").split("*")[:2])
        return -(whole + minutes / 60.0) if text.startswith("-") else whole + minutes / 60.0

    latitude, longitude = degrees(b":Gt#"), -degrees(b":Gg#")
    time.sleep(0.5)
    return {"told": separation(longitude, latitude, at.site[1], at.site[0])}


THERE, RIGHT = ("off", None, 1.0), ("told", None, 0.1)
CALM = ("--sun", "0")
SPOILING = [
    *(Attack("one program's site and clock", f"{name}: another's goto{', on a wedge' * wedge}", mounts,
             partial(spoils_gotos, wedge, lie, False), THERE, CALM)
      for name, lie in LIES.items() for mounts, wedge in (((FORK, GERMAN), False), ((FORK,), True))),
    *(Attack("one program's site and clock", f"{name}: another's goto after a restart, south", (GERMAN,),
             partial(spoils_gotos, False, LIES[name].replace(b"-33*52", b"+33*52"), True), THERE, CALM, site=SOUTH)
      for name in ("10 N 120 W", "Sydney")),
    *(Attack("one program's site and clock", f"{name}: what another reads{' after a restart' * again}",
             (FORK, GERMAN), partial(spoils_readings, False, LIES[name], again), RIGHT, CALM)
      for name in ("10 N 120 W", "Sydney") for again in (False, True)),
    Attack("one program's site and clock", "10 N 120 W: another's goto by day", (FORK, GERMAN),
           partial(spoils_gotos, False, LIES["10 N 120 W"], False, azimuth=200.0, altitude=20.0), THERE, start=NOON),
]  # fmt: skip

SETTINGS = [*OVERTAKING, *SPOILING]
