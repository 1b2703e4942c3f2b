"""Attacks by syncs and by the ways of gotos: syncs that turn an axis, syncs during a goto, paths of German mounts.

Rows like those of ``attack_limits.py``. A sync of an alt-azimuth mount near its zenith, or of an equatorial one near
its pole, is small on the sky and turns the first axis far; so does a sum of them.
"""

from __future__ import annotations

import time
from functools import partial

from gateway.astro.spherical import hour_angle_to_horizon, separation, wrap180, wrap360
from gateway.protocols.mechanics.truth import sun
from tests.soak.attack_limits import LOWEST, NEAR_SUN, RUNS_ON, Attack, goto, told_position
from tests.soak.attacked import Attacked, Program

#: The afternoon, with the Sun at azimuth 235 and altitude 30 in the north; in the south at azimuth 315.
AFTERNOON = "2026-03-20T14:30:00+00:00"
NORTH, SOUTH = (45.0, 10.0), (-45.0, 10.0)
QUICK = ("--speed", "4")
SUN = ("sun", NEAR_SUN - RUNS_ON, None)
ALTAZ = ("nexstar:cpc/4.21", "nexstar:evolution/5.31", "lx200:lx200gps", "lx200:autostar")


def sync(program: Program, ra: float, dec: float) -> bytes:
    """Sync by LX200; return the reply of :CM#."""
    seconds, arcseconds, sign = round(ra % 360.0 * 240.0) % 86400, round(abs(dec) * 3600), "-" if dec < 0 else "+"
    target = (
        f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#"
        f":Sd{sign}{arcseconds // 3600:02}*{arcseconds // 60 % 60:02}:{arcseconds % 60:02}#"
    )
    program.ask(target.encode(), 2.0, until=b"11")
    return program.ask(b":CM#", 5.0)


def believed(at: Attacked, program: Program) -> tuple[float, float]:
    """Where the mount believes to point: azimuth and altitude."""
    ra, dec = told_position(program)
    return hour_angle_to_horizon(wrap180(at.sky().sidereal(at.now) - ra), dec, at.site[0])


def sun_at(at: Attacked) -> tuple[float, float]:
    """Azimuth and altitude of the true Sun."""
    ra, dec = sun(at.now)
    return hour_angle_to_horizon(wrap180(at.sky().sidereal(at.now) - ra), dec, at.site[0])


def towards_the_sun(at: Attacked, program: Program) -> None:
    """Send the tube to where the mount believes that the Sun is not, and where it truly is."""
    azimuth, altitude = believed(at, program)
    turned = wrap180(azimuth - at.here["azimuth"])
    place = sun_at(at)
    at.begin()
    if goto(program, *at.place(place[0] + turned, place[1] + altitude - at.here["altitude"])):
        at.rests(40.0)
    time.sleep(0.5)


def near_the_zenith(steps: int, degrees: float, altitude: float, at: Attacked) -> None:
    """Turn the azimuth by syncs that each are so many degrees on the sky, then send the tube into the Sun."""
    program = at.program()
    away = sun_at(at)[0] + (180.0 if steps == 1 else 100.0)
    if not goto(program, *at.place(away, altitude)):
        raise RuntimeError("the mount does not go near the zenith")
    at.rests(40.0)
    for _ in range(steps):
        azimuth, high = believed(at, program)
        turn = 180.0 if steps == 1 else degrees / max(0.02, separation(0.0, high, 1.0, high))
        sync(program, *at.place(azimuth + turn, high))
        time.sleep(0.7)
    towards_the_sun(at, program)


def near_the_pole(at: Attacked) -> None:
    """The same on an equatorial mount: nine hours of right ascension near its pole."""
    program = at.program()
    pole = 1.0 if at.site[0] > 0.0 else -1.0
    ra, dec = sun(at.now)
    if goto(program, *at.place(90.0, 45.0)):  # a fork may turn half a circle either way: not past the Sun
        at.rests(60.0)
    if not goto(program, at.at_hour_angle(-60.0), 88.5 * pole):
        raise RuntimeError("the mount does not go near the pole")
    at.rests(60.0)
    told = told_position(program)
    for _ in range(9):
        told = told_position(program)
        sync(program, told[0] + 15.0, told[1])
        time.sleep(0.7)
    turned = wrap180(told_position(program)[0] - at.equatorial(at.here)[0])
    at.begin()
    if goto(program, wrap360(ra + turned), dec):
        at.rests(60.0)
    time.sleep(0.5)


def both_sides(at: Attacked) -> None:
    """Sync north on one side of the pier and south on the other: the declination axis is turned twice as far."""
    program = at.program()
    pole = 1.0 if at.site[0] > 0.0 else -1.0
    for round_ in range(3):
        west = round_ % 2 == 0
        if not goto(program, at.at_hour_angle(40.0 if west else -40.0), 15.0 * pole):
            break
        at.rests(60.0)
        told = told_position(program)
        sync(program, told[0], told[1] + (14.0 if west else -14.0) * pole)
        time.sleep(0.7)
    told, true = told_position(program), at.equatorial(at.here)
    higher = told[1] - true[1]
    at.begin()
    hour_angle = wrap180(at.sky().sidereal(at.now) - told[0])
    if higher * pole > 0.0 and goto(program, at.at_hour_angle(hour_angle), -60.0 * pole + higher):
        at.rests(60.0)
    program.poll(1.0)


def turned_around(degrees: float, arrows: bytes, at: Attacked) -> None:
    """A guide pulse brings the tube over the pole, where a sync may turn the first axis by 180 degrees. Then down."""
    program, pole = at.program(), 1.0 if at.site[0] > 0.0 else -1.0
    program.tell(b":Mgn4300#")
    program.poll(7.0)
    told = told_position(program)
    sync(program, told[0], told[1] - degrees * pole)
    time.sleep(0.7)
    at.begin()
    program.tell(b":RS#" + arrows)
    program.poll(25.0)
    program.tell(b":Q#")
    program.poll(2.0)


def turned_to_the_sun(at: Attacked) -> None:
    """The same; then a goto to where the mount believes to be opposite to the Sun, if it was turned around."""
    program, pole = at.program(), 1.0 if at.site[0] > 0.0 else -1.0
    program.tell(b":Mgn4300#")
    program.poll(7.0)
    told = told_position(program)
    sync(program, told[0], told[1] - 8.0 * pole)
    time.sleep(0.7)
    ra, dec = sun(at.now)
    at.begin()
    if goto(program, wrap360(ra + 180.0), dec - 8.0 * pole):
        at.rests(60.0)
    time.sleep(0.5)


TURNS = "syncs that turn an axis"
#: German mounts: with a side of the pier that they tell, and without; at the start their tubes are at the pole.
AT_THE_POLE = ("nexstar:cge/4.21", "nexstar:cgem/5.31", "nexstar:advanced-gt/4.10", "nexstar:synscan/4.39.05")
TURNED = [
    Attack(TURNS, "one of 3.6° at altitude 88", ALTAZ, partial(near_the_zenith, 1, 3.6, 88.2), SUN,
           start=AFTERNOON, sim=QUICK),
    Attack(TURNS, "one of 3.6° at altitude 88, south", ALTAZ, partial(near_the_zenith, 1, 3.6, 88.2),
           SUN, start=AFTERNOON, sim=QUICK, site=SOUTH),
    Attack(TURNS, "seven of 2° at altitude 80", ALTAZ, partial(near_the_zenith, 7, 2.0, 80.0), SUN,
           start=AFTERNOON, sim=QUICK),
    Attack(TURNS, "six of 0.9° at altitude 87", ALTAZ, partial(near_the_zenith, 6, 0.9, 87.0),
           SUN, start=AFTERNOON, sim=QUICK),
    Attack(TURNS, "nine hours near the pole", ("nexstar:cge/4.21", "nexstar:cgem/5.31"), near_the_pole,
           SUN, ("--lowest", "10"), start=AFTERNOON, sim=QUICK),
    Attack(TURNS, "nine hours near the pole, south", ("nexstar:cgem/5.31",), near_the_pole, SUN,
           start=AFTERNOON, sim=QUICK, site=SOUTH),
    Attack(TURNS, "nine hours near the pole, an old hand control that keeps offsets",
           ("nexstar:nexstar-gps/2.2", "nexstar:cpc/4.03"), near_the_pole, SUN, start=AFTERNOON, sim=QUICK),
    Attack(TURNS, "to and fro on both sides of the pier", ("nexstar:cge/4.21", "nexstar:cgem/5.31"),
           both_sides, ("altitude", LOWEST - RUNS_ON - 15.0, None), sim=QUICK),
    *(Attack(TURNS, f"over the pole, {degrees:g}° at its right ascension, then {arrows.decode()} {name}", AT_THE_POLE,
             partial(turned_around, degrees, arrows), ("altitude", LOWEST - RUNS_ON, None), site=site)
      for degrees, arrows in ((8.0, b":Mw#:Ms#"), (8.0, b":Me#:Mn#"), (0.9, b":Mw#:Ms#"))
      for name, site in (("north", NORTH), ("south", SOUTH))),
    Attack(TURNS, "over the pole, 8° at its right ascension, then to the Sun", AT_THE_POLE, turned_to_the_sun, SUN,
           ("--lowest", "-90"), start=AFTERNOON, sim=QUICK),
]  # fmt: skip

# --- syncs during a goto ----------------------------------------------------------------------------------------------

#: Degrees by which a mount may believe to be elsewhere than it is: what it was told of its own target, and rounding.
KNOWS = ("off", None, 0.6)


def late_sync(left: float, east: float, then: str, at: Attacked) -> dict[str, float]:
    """During a goto, so many degrees before its goal, sync on a place so many degrees east of it."""
    program, other = at.program(), at.program()
    azimuth, altitude = at.here["azimuth"], at.here["altitude"]
    goal = at.place(azimuth + 40.0, max(30.0, min(60.0, altitude + 20.0)))
    at.begin()
    if not goto(program, *goal):
        raise RuntimeError("the goto was refused")
    end = time.monotonic() + 60.0
    while at.off(*goal) > left and time.monotonic() < end:
        time.sleep(0.02)
    ra, dec = goal[0] + east, goal[1]
    seconds, arcseconds, sign = round(ra % 360.0 * 240.0) % 86400, round(abs(dec) * 3600), "-" if dec < 0 else "+"
    program.tell((
        f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#"
        f":Sd{sign}{arcseconds // 3600:02}*{arcseconds // 60 % 60:02}:{arcseconds % 60:02}#:CM#"
    ).encode())  # fmt: skip
    if then == "gone":
        time.sleep(0.3)
        program.reset()
    elif then == "stopped":
        time.sleep(0.2)
        other.tell(b":Q#")
    other.poll(6.0)
    at.rests(30.0)
    other.poll(1.5)
    told = told_position(other)
    return {"off": at.off(*told)}


DURING = "syncs during a goto"
MOUNTS = ("nexstar:cpc/4.21", "nexstar:cgem/5.31", "lx200:lx200gps", "lx200:autostar")
LATE = [
    *(Attack(DURING, f"{name}, {left}° before its goal", MOUNTS, partial(late_sync, left, east, then), KNOWS,
             ("--lowest", "0"))
      for name, east, then in (("6° east", 6.0, ""), ("6° east, its program leaves", 6.0, "gone"),
                               ("on its target, its program leaves", 0.4, "gone"), ("13° west", -13.0, ""))
      for left in (0.3, 1.5)),
    Attack(DURING, "6° east, south", ("nexstar:cgem/5.31", "lx200:autostar"), partial(late_sync, 0.3, 6.0, ""),
           KNOWS, ("--lowest", "0"), site=SOUTH),
    Attack(DURING, "6° east by day", ("nexstar:cpc/4.21",), partial(late_sync, 0.3, 6.0, ""), KNOWS,
           ("--lowest", "0", "--sun", "0"), start=AFTERNOON),
]  # fmt: skip

# --- the ways of gotos ------------------------------------------------------------------------------------------------

#: A degree below the limit, and what a mount runs on after a stop.
WAY = ("altitude", LOWEST - 1.0 - 2.0, None)
GERMANS = ("nexstar:cge/4.21", "nexstar:cge-pro/4.21", "nexstar:cgem/5.31")


def under_the_pole(beyond: float, hour_angle: float, dec: float, at: Attacked) -> None:
    """Drive the tube by an arrow through the pole, so that the side that is told is not its own; then a goto."""
    program, pole = at.program(), 1.0 if at.site[0] > 0.0 else -1.0
    if not goto(program, at.at_hour_angle(beyond), 80.0 * pole):
        raise RuntimeError("the goto to the pole was refused")
    at.rests(40.0)
    program.tell(b":RS#:Mn#" if pole > 0.0 else b":RS#:Ms#")
    end = time.monotonic() + 30.0
    while at.here["altitude"] > LOWEST + 5.0 and time.monotonic() < end:
        program.poll(0.1)
    program.tell(b":Q#")
    program.poll(3.0)
    at.begin()
    if goto(program, at.at_hour_angle(hour_angle), dec * pole):
        program.poll(2.0)
        at.rests(40.0)
    program.poll(1.0)


def between(first: tuple[float, float], second: tuple[float, float], at: Attacked) -> None:
    """From one hour angle and declination to another."""
    program, pole = at.program(), 1.0 if at.site[0] > 0.0 else -1.0
    if goto(program, at.at_hour_angle(first[0]), first[1] * pole):
        at.rests(60.0)
    at.begin()
    if goto(program, at.at_hour_angle(second[0]), second[1] * pole):
        program.poll(2.0)
        at.rests(60.0)
    program.poll(1.0)


def told_short(at: Attacked) -> dict[str, float]:
    """The owner ends a goto before its goal: Stellarium's status tells it."""
    program = at.program()
    ra, dec = at.place(at.here["azimuth"] + 60.0, 40.0)
    at.begin()
    program.tell((20).to_bytes(4, "little") + bytes(8) + round(ra / 360.0 * 2**32).to_bytes(4, "little")
                 + round(dec / 360.0 * 2**32).to_bytes(4, "little", signed=True))  # fmt: skip
    time.sleep(4.0)
    at.owner_stops()
    time.sleep(5.0)
    heard = program.ask(b"", 2.0, until=b"\0never")
    status = int.from_bytes(heard[len(heard) // 24 * 24 - 4 : len(heard) // 24 * 24], "little", signed=True)
    return {"untold": float(status >= 0)}


def not_below(at: Attacked) -> dict[str, float]:
    """A tube that stands low under the pole is sent to objects that stand high: none of them is below the horizon."""
    program, pole = at.program(), 1.0 if at.site[0] > 0.0 else -1.0
    wrong = 0
    if goto(program, at.at_hour_angle(-170.0), 68.0 * pole):
        at.rests(60.0)
    at.begin()
    for hour_angle in range(-75, -10, 15):
        ra, dec = at.at_hour_angle(float(hour_angle)), 20.0 * pole
        seconds, sign = round(ra * 240.0) % 86400, "+" if dec > 0.0 else "-"
        target = f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#:Sd{sign}20*00:00#"
        program.ask(target.encode(), 2.0, until=b"11")
        wrong += program.ask(b":MS#", 5.0, until=b"0").startswith(b"1")
        program.tell(b":Q#")
        program.poll(2.0)
    return {"wrong": float(wrong)}


WAYS = [
    *(Attack("ways", f"from under the pole, driven by an arrow, to {hour_angle:+g}° {name}", GERMANS,
             partial(under_the_pole, 4.0, hour_angle, dec), WAY, site=site)
      for name, site in (("north", NORTH), ("south", SOUTH))
      for hour_angle, dec in ((1.0, 43.6), (-60.0, 10.0))),
    *(Attack("ways", f"from {first} to {second} {name}", ("nexstar:cge/4.21",), partial(between, first, second), WAY,
             ("--lowest", "10", "--sun", "0"), site=site)
      for name, site in (("north", NORTH), ("south", SOUTH))
      for first, second in (((-173.0, 62.0), (-25.0, 17.0)), ((-174.0, 66.0), (1.0, 40.0)),
                            ((170.0, 66.0), (-2.0, 30.0)))),
    Attack("ways", "high objects from a low tube are not below the horizon", ("nexstar:cgem/5.31", "nexstar:cge/4.21"),
           not_below, ("wrong", None, 0.0), ("--lowest", "20", "--sun", "0"), sim=QUICK),
    Attack("ways", "high objects from a low tube are not below the horizon, south", ("nexstar:cgem/5.31",), not_below,
           ("wrong", None, 0.0), ("--lowest", "20", "--sun", "0"), sim=QUICK, site=SOUTH),
    Attack("ways", "a goto that its owner ends is told", ("nexstar:cge/4.21", "nexstar:cpc/4.21", "lx200:lx200gps"),
           told_short, ("untold", None, 0.0), ("--lowest", "0", "--sun", "0"), "stellarium"),
]  # fmt: skip

SYNCS_AND_WAYS = [*TURNED, *LATE, *WAYS]
