"""The settings of a simulated Meade: site, clock, formats, limits, names."""

from __future__ import annotations

import calendar
import re
from datetime import UTC, date, datetime, timedelta

from gateway.astro.spherical import wrap180
from gateway.core.operations import Values
from gateway.protocols.lx200.simulator.answers import encode
from gateway.protocols.lx200.simulator.telescope import Handler, MeadeTelescope
from gateway.protocols.lx200.simulator.tracking import ALIGN_TIME
from gateway.protocols.wireformat import sexagesimal

#: Seconds in which a classic computes its planets after a new date, and an LX200GPS finds satellites.
PLANETS_DURATION, GPS_FIX_DURATION = 5.0, 60.0
_SITE_MARK = b"\x02"  # marks the selected site in a classic's menu
_NAME_WIDTH = 12  # columns of that menu
_TYPES = re.compile("[Gg][Pp][Dd][Cc][Oo]")
_SEARCH_LIMIT_BY_LETTER = {
    "b": ("magnitude", -5.5),
    "f": ("magnitude", 20.0),
    "F": ("field", 15),
    "l": ("size", 0),
    "s": ("size", 200),
    "y": ("types", "GPDCO"),
    "q": ("quality", "VP"),
}
_QUALITIES = ("SU", "EX", "VG", "GD", "FR", "PR", "VP")


def reply_duration(sim: MeadeTelescope, command: str) -> float:
    """Return how many seconds pass before the last part of this command's reply."""
    return {"SC": PLANETS_DURATION if sim.classic else 0.0, "gT": GPS_FIX_DURATION, "Aa": ALIGN_TIME}.get(command, 0.0)


def _local_time(sim: MeadeTelescope) -> datetime:
    return datetime.fromtimestamp(sim.utc() + sim.utc_offset * 3600.0, UTC)


def clock(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GL :Ga :GC - local time and date."""
    local = _local_time(sim)
    return encode(sim, command, time=local.hour * 3600 + local.minute * 60 + local.second, date=local.date())


def utc_offset(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GG - the offset from UTC, without padding on a classic."""
    if sim.classic and sim.utc_offset == int(sim.utc_offset):
        return f"{-int(sim.utc_offset):+d}#".encode()
    return encode(sim, command, offset=-sim.utc_offset)


def sidereal_time(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GS - the sidereal time: as set by :SS, else by clock and site."""
    return encode(sim, command, sidereal=sim.mechanics.sky.lst(sim.now) + sim.stored_values.get("sidereal ahead", 0.0))


def set_sidereal(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SS - set only the displayed time: the motors use clock and site."""
    sim.stored_values["sidereal ahead"] = values["sidereal"] - sim.mechanics.sky.lst(sim.now)
    return b"1"


def _set_clock(sim: MeadeTelescope, local_time: datetime) -> None:
    sim.clock_ahead = calendar.timegm(local_time.timetuple()) - sim.utc_offset * 3600.0 - sim.now
    sim.relocate()


def set_time(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SL - set the local time."""
    midnight = _local_time(sim).replace(hour=0, minute=0, second=0)
    _set_clock(sim, midnight + timedelta(seconds=int(values["time"])))
    return b"1"


def set_date(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SC - set the date; an LX200GPS expects the UTC date."""
    new: date = values["date"]
    if sim.facts["utc_date"]:
        sim.clock_ahead += (new - datetime.fromtimestamp(sim.utc(), UTC).date()).total_seconds()
        sim.relocate()
    else:
        _set_clock(sim, _local_time(sim).replace(year=new.year, month=new.month, day=new.day))
    if sim.classic:
        return b"1Updating        planetary data. #" + b" " * 32 + b"#"
    return b"1Updating Planetary Data#" + b" " * 24 + b"#"


def set_offset(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SG - set the offset from UTC and keep the local time."""
    sim.clock_ahead += (sim.utc_offset + values["offset"]) * 3600.0
    sim.utc_offset = -values["offset"]
    sim.relocate()
    return b"1"


def set_date_and_time(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:hI - set date and time together."""
    try:
        _set_clock(sim, datetime.strptime(values["stamp"], "%y%m%d%H%M%S").replace(tzinfo=UTC))
    except ValueError:
        return b""
    return b"1"


def set_clock_from_gps(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:gT - set the clock by GPS."""
    sim.clock_ahead = 0.0
    sim.relocate()
    return b"1"


def latitude(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:Gt - the latitude, with seconds on an LX200GPS."""
    if sim.model != "lx200gps":
        return encode(sim, command, latitude=sim.site[0])
    return _angle_reply(sexagesimal.signed(sim.site[0]))


def longitude(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:Gg - the longitude, west positive: signed on an Autostar, unsigned on others, with seconds on an LX200GPS."""
    west = -sim.site[1] % 360.0
    if sim.model == "autostar":
        return encode(sim, command, longitude=wrap180(west))
    return _angle_reply(sexagesimal.azimuth_low(west) if sim.classic else sexagesimal.azimuth(west))


def _angle_reply(text: str) -> bytes:
    """Return the reply with the degree byte of real hardware."""
    return text.replace("*", "\xdf").encode("latin-1") + b"#"


def set_site_coordinate(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:St :Sg - set latitude or longitude of the site; an Autostar replies 0 to a valid latitude."""
    north, east = sim.site
    sim.sites[sim.site_number] = values.get("latitude", north), wrap180(-values.get("longitude", -east))
    sim.relocate()
    return b"0" if command == "St" and sim.model == "autostar" else b"1"


def select_site(sim: MeadeTelescope, command: str, values: Values) -> None:
    """:W - select a site. Models count from 0 or from 1; those that count from 1 accept 0 for the first."""
    number = max(0, values["site"] - sim.facts["first_site"])
    if number < len(sim.sites):
        sim.site_number = number
        sim.relocate()


def site_name(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:GM :GN :GO :GP - the name of a site; a classic sends a line of its menu, which marks the selected site."""
    number = "MNOP".index(command[1])
    name = sim.names[number].encode("latin-1")
    if not sim.classic:
        return name + b"#"
    return name.ljust(_NAME_WIDTH) + (_SITE_MARK if number == sim.site_number else b" ") + b"#"


def set_site_name(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:SM :SN :SO :SP - name a site."""
    if not 0 < len(values["name"]) <= sim.facts["names"]:
        return b"0"
    sim.names["MNOP".index(command[1])] = values["name"]
    return b"1"


def set_limit(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:So :Sh - set the lowest or highest altitude, degrees."""
    sim.stored_values["lowest" if command == "So" else "highest"] = float(values["limit"])
    return b"1"


def search_limit(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:Gb :Gf :GF :Gl :Gs :Gy :Gq - the limits of a search."""
    field, default = _SEARCH_LIMIT_BY_LETTER[command[1]]
    return encode(sim, command, **{field: sim.stored_values.get("search " + command[1], default)})


def set_search_limit(sim: MeadeTelescope, command: str, values: Values) -> bytes:
    """:Sb :Sf :SF :Sl :Ss :Sy - set a limit of searches."""
    if command == "Sy" and not _TYPES.fullmatch(values["types"]):
        return b"0"
    sim.stored_values["search " + command[1]] = next(iter(values.values()))
    return b"1"


def step_quality(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:Sq - step to the next lower quality of searches, from the lowest back to the highest."""
    present = sim.stored_values.get("search q", "VP")
    sim.stored_values["search q"] = _QUALITIES[(_QUALITIES.index(present) + 1) % len(_QUALITIES)]


def toggle_precision(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:U - switch between low and high precision."""
    sim.high_precision = not sim.high_precision


def toggle_pointing(sim: MeadeTelescope, command: str, _: Values) -> bytes:
    """:P - toggle high-precision pointing."""
    on = sim.stored_values["pointing"] = not sim.stored_values.get("pointing", False)
    return b"HIGH PRECISION" if on else b"LOW  PRECISION"


def toggle_hours(sim: MeadeTelescope, command: str, _: Values) -> None:
    """:H - switch between 12 and 24 hours."""
    sim.stored_values["twelve"] = not sim.stored_values.get("twelve", False)


HANDLERS: dict[str, Handler] = {
    "GL": clock, "Ga": clock, "GC": clock, "GG": utc_offset, "GS": sidereal_time, "SL": set_time, "SC": set_date,
    "SG": set_offset, "hI": set_date_and_time, "gT": set_clock_from_gps, "Gt": latitude, "Gg": longitude,
    "St": set_site_coordinate, "Sg": set_site_coordinate, "W": select_site, "So": set_limit, "Sh": set_limit,
    "Sq": step_quality, "U": toggle_precision, "P": toggle_pointing, "H": toggle_hours, "SS": set_sidereal,
    "Go": lambda sim, name, _: encode(sim, name, limit=sim.stored_values["lowest"]),
    "Gh": lambda sim, name, _: encode(sim, name, limit=sim.stored_values["highest"]),
    "Gc": lambda sim, name, _: b"12#" if sim.stored_values.get("twelve") else b"24#", "SB": lambda sim, name, _: b"1",
    **dict.fromkeys(("GM", "GN", "GO", "GP"), site_name), **dict.fromkeys(("SM", "SN", "SO", "SP"), set_site_name),
    **dict.fromkeys(("Gb", "Gf", "GF", "Gl", "Gs", "Gy", "Gq"), search_limit),
    **dict.fromkeys(("Sb", "Sf", "SF", "Sl", "Ss", "Sy"), set_search_limit),
}  # fmt: skip
