"""The attacks on the distance from the Sun: syncs, clocks and sites that put the mount's sky elsewhere.

Each goes to a place that the mount believes to be far from the Sun, and that truly is the Sun or beside it. The mount
is right before the attack. North and south: 45 N 10 E, and 33 S 151 E.
"""

from __future__ import annotations

import time
from functools import partial

from gateway.astro.axes import Sky
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, wrap180, wrap360
from gateway.protocols.mechanics.truth import sun
from tests.soak.attack_limits import AUTOSTAR, FORK, GERMAN, MEADE, NEAR_SUN, Attack, angle, goto
from tests.soak.attacked import Attacked, Program

NEWER_FORK, NEWER_GERMAN, NO_GPS = "nexstar:evolution/5.31", "nexstar:cgem/5.31", "lx200:lx200-16"
NORTH, SOUTH = (45.0, 10.0), (-33.0, 151.0)
#: Site -> when the Sun is 30 to 50 degrees high there, on the day of the equinox; and a summer's forenoon.
AFTERNOON = {NORTH: "2026-03-20T14:30:00+00:00", SOUTH: "2026-03-20T04:30:00+00:00"}
FORENOON = {NORTH: "2026-06-21T08:00:00+00:00", SOUTH: "2026-01-10T22:00:00+00:00"}
#: By how many degrees a motion may run on; one degree is what no source of site and time can tell.
RUNS_ON = 0.3
SUN = ("sun", NEAR_SUN - 1.0 - RUNS_ON, None)
Site = tuple[float, float]
HOUR = 3600.0


def equatorial(at: Attacked, sky: Sky, azimuth: float, altitude: float) -> tuple[float, float]:
    """What a mount with this site and clock calls right ascension and declination of an azimuth and altitude."""
    hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, sky.latitude)
    return wrap360(sky.sidereal(at.now) - hour_angle), dec


def the_sun(at: Attacked, site: Site) -> tuple[float, float]:
    """Azimuth and altitude of the Sun."""
    ra, dec = sun(at.now)
    return hour_angle_to_horizon(wrap180(Sky(*site).sidereal(at.now) - ra), dec, site[0])


def sync(program: Program, ra: float, dec: float) -> None:
    seconds, arcseconds = round(ra / 15.0 % 24.0 * 3600) % 86400, round(abs(dec) * 3600)
    target = (
        f":Sr{seconds // 3600:02}:{seconds // 60 % 60:02}:{seconds % 60:02}#"
        f":Sd{'-' if dec < 0 else '+'}{arcseconds // 3600:02}*{arcseconds // 60 % 60:02}:{arcseconds % 60:02}#"
    )
    program.ask(target.encode(), 2.0, until=b"11")
    program.ask(b":CM#", 5.0)
    time.sleep(0.5)


def arrives(at: Attacked, program: Program, ra: float, dec: float, seconds: float = 60.0) -> None:
    if goto(program, ra, dec):
        at.rests(seconds)


# --- syncs ------------------------------------------------------------------------------------------------------------


def sync_at_the_zenith(site: Site, altitude: float, turn: float, at: Attacked) -> None:
    """One sync near the zenith that turns the azimuth; then to the place that is the Sun if the turn is believed."""
    program, sky = at.program(), Sky(*site)
    azimuth, height = the_sun(at, site)
    arrives(at, program, *equatorial(at, sky, azimuth - turn, altitude))
    at.begin()
    sync(program, *equatorial(at, sky, azimuth, altitude))
    azimuth, height = the_sun(at, site)
    arrives(at, program, *equatorial(at, sky, azimuth + turn, height))


def syncs_beside_the_zenith(site: Site, at: Attacked) -> None:
    """Seven syncs of 2 degrees at altitude 80, each in azimuth; then to what is the Sun by then."""
    program, sky, turned = at.program(), Sky(*site), 0.0
    azimuth, _ = the_sun(at, site)
    arrives(at, program, *equatorial(at, sky, azimuth - 80.0, 80.0))
    at.begin()
    for _ in range(7):
        turned += 11.4
        sync(program, *equatorial(at, sky, azimuth - 80.0 + turned, 80.0))
    azimuth, height = the_sun(at, site)
    arrives(at, program, *equatorial(at, sky, azimuth + turned, height))


def sync_within_the_limit(site: Site, degrees: float, at: Attacked) -> None:
    """One sync of right ascension that is permitted, or was; then to a place that far beside the circle."""
    program = at.program()
    ra, dec = sun(at.now)
    arrives(at, program, ra + 60.0, dec + 10.0)
    at.begin()
    sync(program, ra + 60.0 + degrees, dec + 10.0)
    arrives(at, program, ra + degrees + 8.0, dec)


# --- clocks and sites that the mount takes ----------------------------------------------------------------------------


def set_clock(program: Program, at: Attacked, ahead: float) -> None:
    """Set the mount's clock by :SG :SL :SC, in UTC."""
    moment = time.gmtime(at.now + ahead)
    told = time.strftime(":SG+00#:SL%H:%M:%S#:SC%m/%d/%y#", moment)
    program.ask(told.encode(), 4.0, until=b"\0")
    time.sleep(3.0)


def wrong_clock(site: Site, ahead: float, beside: float, at: Attacked) -> None:
    """A program sets the clock; then to the Sun's place on the sky that the mount has then."""
    program = at.program()
    set_clock(program, at, ahead)
    at.begin()
    azimuth, altitude = the_sun(at, site)
    arrives(at, program, *equatorial(at, Sky(*site, ahead), azimuth + beside, altitude))


def wrong_clock_by_horizon(site: Site, ahead: float, at: Attacked) -> None:
    """The same by azimuth and altitude, ``:MA#``."""
    program = at.program()
    set_clock(program, at, ahead)
    at.begin()
    azimuth, altitude = the_sun(at, site)
    program.ask(f":Sz{azimuth:03.0f}*00#:Sa+{altitude:02.0f}*00#:MA#".encode(), 8.0, until=b"110")
    at.rests(60.0)


def wrong_clock_by_arrow(site: Site, ahead: float, at: Attacked) -> None:
    """A program sets the clock, goes to 30 degrees east of the Sun and presses the arrow west."""
    program = at.program()
    azimuth, altitude = the_sun(at, site)
    side = -32.0 if site[0] > 0 else 32.0
    arrives(at, program, *equatorial(at, Sky(*site), azimuth + side, altitude))
    set_clock(program, at, ahead)
    at.begin()
    program.tell(b":RM#:Mw#")
    program.poll(25.0)


def wrong_site(site: Site, told: bytes, believed: Site, at: Attacked) -> None:
    """A program sets the site; the owner's is in the configuration."""
    program = at.program()
    program.ask(told, 4.0, until=b"11")
    time.sleep(5.0)
    at.begin()
    azimuth, altitude = the_sun(at, site)
    hour_angle, dec = horizon_to_hour_angle(azimuth, altitude, believed[0])
    arrives(at, program, wrap360(Sky(*believed).sidereal(at.now) - hour_angle), dec)


def wrong_clock_nexstar(site: Site, ahead: float, at: Attacked) -> None:
    """A NexStar program sets the clock of an aligned hand control that may be set, then goes to what is the Sun."""
    program = at.program()
    moment = time.gmtime(at.now + ahead)
    program.ask(bytes((ord("H"), *moment[3:6], moment[1], moment[2], moment[0] - 2000, 0, 0)), 3.0)
    time.sleep(5.0)
    at.begin()
    azimuth, altitude = the_sun(at, site)
    ra, dec = equatorial(at, Sky(*site, ahead), azimuth, altitude)
    program.ask(b"r" + angle(ra) + b"," + angle(dec), 5.0)
    at.rests(60.0)


ALTAZ = (FORK, NEWER_FORK, MEADE, AUTOSTAR)
LOW = ("--lowest", "-90")
ANY_SYNC = (*LOW, "--sync-limit", "180")


def attack(name: str, mounts: tuple[str, ...], script: object, site: Site, *options: str, **more: object) -> Attack:
    where = "north" if site is NORTH else "south"
    start = more.pop("start", AFTERNOON[site])
    return Attack("the Sun", f"{name}, {where}", mounts, script, SUN, options or LOW, start=start,
                  sim=("--site", f"{site[0]:g},{site[1]:g}"), settled=4.0, **more)  # type: ignore[arg-type]  # fmt: skip


SUNS = [
    *(attack(f"a sync of 3.6° at altitude 88.2{words}", ALTAZ, partial(sync_at_the_zenith, site, 88.2, 180.0), site,
             *more) for site in (NORTH, SOUTH) for words, more in (("", LOW), (", `sync-limit` 180", ANY_SYNC))),
    attack("a sync of 1° at altitude 89, `sync-limit` 180", ALTAZ, partial(sync_at_the_zenith, NORTH, 89.0, 60.0),
           NORTH, *ANY_SYNC),
    attack("seven syncs of 2° at altitude 80", ALTAZ, partial(syncs_beside_the_zenith, NORTH), NORTH),
    attack("seven syncs of 2° at altitude 80, `sync-limit` 180", ALTAZ, partial(syncs_beside_the_zenith, SOUTH), SOUTH,
           *ANY_SYNC),
    *(attack(f"a sync of {degrees:g}°", (GERMAN, NEWER_GERMAN, MEADE), partial(sync_within_the_limit, site, degrees),
             site) for site in (NORTH, SOUTH) for degrees in (14.0, -14.0)),
    *(attack(f"a clock {abs(hours):g} h {'slow' if hours < 0 else 'fast'}, goto", (MEADE, AUTOSTAR, NO_GPS),
             partial(wrong_clock, site, hours * HOUR, 0.0), site, start=FORENOON[site])
      for site in (NORTH, SOUTH) for hours in (-3.0, -1.5, 2.0, 4.0)),
    *(attack(f"a clock 3 h slow, goto to 15° {words} the Sun", (MEADE, AUTOSTAR),
             partial(wrong_clock, NORTH, -3 * HOUR, beside), NORTH)
      for words, beside in (("left of", -15.0), ("right of", 15.0))),
    *(attack("a clock 3 h slow, `:MA#`", (MEADE, AUTOSTAR), partial(wrong_clock_by_horizon, site, -3 * HOUR), site)
      for site in (NORTH, SOUTH)),
    *(attack("a clock 3 h slow, arrow", (MEADE, AUTOSTAR), partial(wrong_clock_by_arrow, site, -3 * HOUR), site)
      for site in (NORTH, SOUTH)),
    *(attack(f"a clock {abs(hours):g} h {'slow' if hours < 0 else 'fast'}, `H`, `site-time` always",
             (FORK, GERMAN, NEWER_GERMAN), partial(wrong_clock_nexstar, site, hours * HOUR), site, *LOW, "--site-time",
             "always", surface="nexstar:cge/4.21", start=FORENOON[site])
      for site in (NORTH, SOUTH) for hours in (-3.0, 3.0)),
    attack("longitude with the wrong sign, `site` 45,10", (MEADE, AUTOSTAR),
           partial(wrong_site, NORTH, b":Sg010*00#", (45.0, -10.0)), NORTH, *LOW, "--site", "45,10"),
    attack("a planned site 60° west, `site` 45,10", (MEADE, AUTOSTAR),
           partial(wrong_site, NORTH, b":Sg050*00#", (45.0, -50.0)), NORTH, *LOW, "--site", "45,10"),
    attack("latitude with the wrong sign, `site` -33,151", (MEADE, AUTOSTAR),
           partial(wrong_site, SOUTH, b":St+33*00#", (33.0, 151.0)), SOUTH, *LOW, "--site", "-33,151"),
    attack("longitude with the wrong sign, `site` -33,151", (MEADE, AUTOSTAR),
           partial(wrong_site, SOUTH, b":Sg151*00#", (-33.0, -151.0)), SOUTH, *LOW, "--site", "-33,151"),
]  # fmt: skip
