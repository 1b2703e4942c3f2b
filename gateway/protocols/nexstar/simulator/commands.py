"""The hand control's own commands: position, goto, sync, tracking, identity, clocks and sites.

A handler returns the values of the reply, if it has any; most replies are a bare ``#`` whatever was done. Like a real
hand control it acknowledges an impossible request without carrying it out, and without an alignment only motor
positions have a meaning. It uses the time and site that a client has set. The GPS unit (176) has the true position
and time; the RTC (178) keeps the true time until it is set. Both use Universal Time (NexStar protocol, Time/Location,
GPS and RTC Commands).
"""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

from gateway.astro.axes import Build, Observer, Pair
from gateway.astro.ephemeris.sky import Sky
from gateway.astro.spherical import fold_declination, wrap180
from gateway.core.operations import Values
from gateway.protocols.nexstar.counting import clock_fields, unix_time
from gateway.protocols.nexstar.simulator.mount import (
    ALTAZ,
    AZM,
    EQ_NORTH,
    EQ_SOUTH,
    GPS,
    OFF,
    RTC,
    Handler,
    RestartableGoto,
    SimulatedMount,
)
from gateway.protocols.nexstar.versions import MODES, NEXSTAR_VARIANT, STARSENSE_VARIANT, letters_swapped, mode_code
from gateway.protocols.wireformat.rows import parse_version

#: Slew limits of a fork, degrees of altitude.
MIN_ALT, MAX_ALT = -5.0, 90.0
#: Converts coordinates of date to and from J2000, for mounts that use J2000.
SKY = Sky()
#: The equatorial mode of a SynScan with periodic error correction.
PEC_MODE = 3
#: The numbers of the tracking modes in the simulator.
NUMBER_BY_MODE = {mode: number for number, mode in MODES.items()}
MIN_ZONE, MAX_ZONE = -12, 14  # hours: the zones in use


def position(sim: SimulatedMount, _: Values) -> Values:
    """``E`` ``e``: right ascension and declination, of date or of J2000."""
    ra, dec = sim.mechanics.believed_position(sim.now)
    if sim.facts.get("equinox") == "j2000":
        ra, dec = SKY.to_j2000(*fold_declination(ra, dec), sim.utc())
    return {"ra": ra, "dec": dec}


def _goal_of_date(sim: SimulatedMount, values: Values) -> Pair:
    """Return right ascension and declination of a command, of date."""
    ra, dec = values["ra"], values["dec"]
    return SKY.from_j2000(ra, dec, sim.utc()) if sim.facts.get("equinox") == "j2000" else (ra, dec)


def axes(sim: SimulatedMount, _: Values) -> Values:
    """``Z`` ``z``: the motor positions; on an aligned alt-az mount these are azimuth and altitude."""
    az, alt = sim.encoders()
    return {"az": az, "alt": alt}


def goto(sim: SimulatedMount, values: Values) -> None:
    """``R`` ``r``: slew, unless the mount is not aligned or the goal is beyond a fork's slew limits. A SynScan begins
    to track, and an old SynScan may restart the goto after ``M``.
    """
    if sim.aligned:
        ra, dec = _goal_of_date(sim, values)
        hour_angle = wrap180(sim.mechanics.sky.lst(sim.now) - ra)
        if _is_altitude_allowed(sim, sim.mechanics.geometry.to_axes(hour_angle, dec, flipped=False)[1]):
            if "dialect" in sim.facts and sim.mode == OFF:
                sim.track(_default_mode(sim))
            sim.mechanics.goto_sky(sim.now, ra, dec)
            if sim.reported_version[:2] <= parse_version(sim.facts.get("restarts", "0.0")):
                sim.goto = RestartableGoto(ra, dec)


def _default_mode(sim: SimulatedMount) -> int:
    """Return the equatorial mode of the hemisphere, on a fork alt-az."""
    return ALTAZ if not sim.german else EQ_NORTH if sim.mechanics.sky.latitude >= 0.0 else EQ_SOUTH


def goto_axes(sim: SimulatedMount, values: Values) -> None:
    """``B`` ``b``: slew to axis readings. Without an alignment they count from the position at power-on."""
    if _is_altitude_allowed(sim, values["alt"]):
        first, second = sim.encoder_offset
        sim.mechanics.goto_axes(sim.now, values["az"] - first, values["alt"] - second)


def _is_altitude_allowed(sim: SimulatedMount, altitude: float) -> bool:
    return sim.mechanics.build is not Build.ALTAZ or MIN_ALT <= altitude <= MAX_ALT


def sync(sim: SimulatedMount, values: Values) -> None:
    """``S`` ``s``: correct right ascension and declination from now on; the motor positions stay."""
    if sim.aligned:
        sim.mechanics.sync(sim.now, *_goal_of_date(sim, values))


def undo_sync(sim: SimulatedMount, _: Values) -> None:
    """``u``: remove the corrections of all syncs."""
    if sim.aligned:
        sim.mechanics.correct(sim.now, (0.0, 0.0))


def cancel(sim: SimulatedMount, _: Values) -> None:
    """``M``: end a goto; hand motion continues."""
    if sim.goto is not None:
        sim.goto = RestartableGoto(sim.goto.ra, sim.goto.dec, sim.now) if sim.mechanics.slewing(sim.now) else None
    sim.mechanics.stop_goto(sim.now)


def set_mode(sim: SimulatedMount, values: Values) -> None:
    """``T``: set the tracking mode. EQ modes put a fork on its wedge; a German mount has no alt-az tracking."""
    if not sim.aligned or values["mode"] not in sim.mode_by_code:
        return
    wanted = sim.mode_by_code[values["mode"]]
    if wanted is None and not sim.german:
        return  # an alt-az mount of Sky-Watcher has no equatorial mode
    mode = _default_mode(sim) if wanted is None else NUMBER_BY_MODE[wanted]
    if mode != ALTAZ or not sim.german:
        if "dialect" in sim.facts:
            sim.settings["periodic error", AZM] = int(values["mode"] == PEC_MODE)
        sim.track(mode)


def mode(sim: SimulatedMount, _: Values) -> Values:
    """``t``: the tracking mode."""
    code = mode_code(MODES[sim.mode], sim.facts, sim.version)
    corrects = "dialect" in sim.facts and sim.settings.get(("periodic error", AZM)) and code in (PEC_MODE - 1, PEC_MODE)
    return {"mode": PEC_MODE if corrects else code}


def pier_side(sim: SimulatedMount, _: Values) -> Values:
    """``p``: the pier side, by the hour angle of the last goto; a fork is always E."""
    west = sim.german and sim.mechanics.flipped
    if sim.german and sim.mechanics.geometry.pole_sign < 0 and not letters_swapped(sim.facts, sim.version):
        west = not west
    return {"side": "W" if west else "E"}


def hibernate(sim: SimulatedMount, _: Values) -> None:
    """``x``: stop everything; until ``y`` only ``y``, ``K`` and ``V`` are answered."""
    sim.mechanics.stop_goto(sim.now)
    sim.mechanics.track(sim.now, on=False)
    sim.asleep = True


def wake(sim: SimulatedMount, _: Values) -> None:
    """``y``: wake up, and track in the last mode."""
    if sim.asleep:
        sim.asleep = False
        sim.track(sim.mode)


# --- clocks and sites ---------------------------------------------------------------------------------------------


def _to_utc(unix: float) -> datetime:
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=unix)


def _local_time(sim: SimulatedMount, zone: float) -> Values:
    """``h`` ``i``: local date and time in a zone (hours east)."""
    local = _to_utc(sim.utc() + (zone + sim.daylight) * 3600)
    return {**clock_fields(local), "dst": sim.daylight, "zone": int(zone), "quarters": round(zone * 4)}


def _set_time(sim: SimulatedMount, values: Values, zone: float) -> Values:
    """``H`` ``I``: UTC is local time less the zone less daylight saving; impossible values change nothing."""
    if not MIN_ZONE <= zone <= MAX_ZONE or values["dst"] > 1 or values["year"] > 99:
        return {}
    try:
        local = unix_time(values)
    except ValueError:
        return {}
    sim.zone, sim.daylight = zone, values["dst"]
    sim.relocate(sim.mechanics.sky._replace(clock_ahead=local - (zone + sim.daylight) * 3600 - sim.now))
    return {}


def _set_site(sim: SimulatedMount, values: Values) -> None:
    sim.relocate(Observer(values["latitude"], values["longitude"], sim.mechanics.sky.clock_ahead))


# --- GPS unit and real-time clock -----------------------------------------------------------------------


def _true_time(sim: SimulatedMount, device: int) -> datetime:
    return _to_utc(sim.now + (sim.rtc_ahead if device == RTC else 0.0))


def _make_time_reader(device: int, *names: str) -> Handler:
    """Return a handler that reports these parts of a device's date and time."""

    def read_parts(sim: SimulatedMount, _: Values) -> Values:
        time = _true_time(sim, device)
        return {name: getattr(time, name) for name in names}

    return read_parts


def _set_rtc(sim: SimulatedMount, values: Values) -> Values:
    """Replace a part of the RTC's date or time; an impossible value changes nothing."""
    time = _true_time(sim, RTC)
    try:
        wanted = time.replace(**{name: value for name, value in values.items() if name != "device"})
    except ValueError:
        return {}
    sim.rtc_ahead += (wanted - time).total_seconds()
    return {}


HANDLER_BY_COMMAND: dict[str, Handler] = {
    "E": position, "e": position, "Z": axes, "z": axes, "R": goto, "r": goto, "B": goto_axes, "b": goto_axes,
    "S": sync, "s": sync, "u": undo_sync, "M": cancel, "T": set_mode, "p": pier_side, "x": hibernate, "y": wake,
    "t": mode,
    "L": lambda sim, _: {"slewing": "1" if sim.mechanics.slewing(sim.now) else "0"},
    "J": lambda sim, _: {"aligned": int(sim.aligned)},
    "K": lambda sim, values: values,
    "V": lambda sim, _: dict(zip(("major", "minor", "patch"), (*sim.reported_version, 0), strict=False)),
    "v": lambda sim, _: {"variant": STARSENSE_VARIANT if sim.starsense else NEXSTAR_VARIANT},
    "m": lambda sim, _: {"model": sim.facts["id"]},
    # The zone byte of h holds whole hours, so a zone of 5:45 is reported as 5, with the matching local time.
    "h": lambda sim, _: _local_time(sim, math.floor(sim.zone)),
    "H": lambda sim, values: _set_time(sim, values, values["zone"]),
    "i": lambda sim, _: _local_time(sim, sim.zone),
    "I": lambda sim, values: _set_time(sim, values, values["quarters"] / 4),
    "w": lambda sim, _: {"latitude": sim.mechanics.sky.latitude, "longitude": sim.mechanics.sky.longitude},
    "W": _set_site,
    "l": lambda sim, _: {"sidereal": sim.mechanics.sky.lst(sim.now)},
    **dict.fromkeys(("gps_linked", "gps_time_valid"), lambda sim, _: {"linked": 1, "valid": 1}),
    "gps_latitude": lambda sim, _: {"latitude": sim.site[0]},
    "gps_longitude": lambda sim, _: {"longitude": sim.site[1]},
    "gps_date": _make_time_reader(GPS, "month", "day"),
    "gps_year": _make_time_reader(GPS, "year"),
    "gps_time": _make_time_reader(GPS, "hour", "minute", "second"),
    "rtc_date": _make_time_reader(RTC, "month", "day"),
    "rtc_year": _make_time_reader(RTC, "year"),
    "rtc_time": _make_time_reader(RTC, "hour", "minute", "second"),
    **dict.fromkeys(("rtc_set_date", "rtc_set_year", "rtc_set_time"), _set_rtc),
}  # fmt: skip
