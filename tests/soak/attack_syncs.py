"""Attacks by syncs during a goto and by the ways of gotos of German mounts. Rows like those of ``attack_limits.py``."""

from __future__ import annotations

import time
from functools import partial

from tests.soak.attack_limits import LOWEST, Attack, goto, told_position
from tests.soak.attacked import Attacked

#: The afternoon, with the Sun at azimuth 235 and altitude 30 in the north; in the south at azimuth 315.
AFTERNOON = "2026-03-20T14:30:00+00:00"
NORTH, SOUTH = (45.0, 10.0), (-45.0, 10.0)
QUICK = ("--speed", "4")


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

SYNCS_AND_WAYS = [*LATE, *WAYS]
