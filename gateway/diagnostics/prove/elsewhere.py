"""The site and the times that a bundle tells in place of the true ones, and what a recording tells of these."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from random import Random, SystemRandom
from typing import Any

import msgspec
from msgspec import Struct

from gateway.app.config import parse_endpoint
from gateway.app.recording.format import Event, Recording
from gateway.app.state.file import SavedState, site_of_program
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, separation, wrap180
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.core.wire_log import MOUNT
from gateway.diagnostics.log.conversation import Heard, Side

#: Seconds in which the sky turns by 15 degrees; to how many degrees a latitude is rounded.
HOUR, ROUND = 86164.0905 / 24.0, 5.0
#: Minutes of arc by which a longitude is shifted beyond whole hours, at most.
MINUTES = 420
#: The least step in which a mount tells an angle; degrees within which two sites are one.
TICK, SAME_SITE = 360.0 / 2**24, 0.1


class Elsewhere(Struct, frozen=True):
    """Where and when a bundle says that it was: ``east`` of the true site by so many hours, and as much earlier.
    ``zone`` is what is added to the hours of a time zone; ``true`` is the latitude of the true site, None if that is
    not known.
    """

    true: float | None
    latitude: float
    longitude: float
    zone: float
    east: float

    @property
    def seconds(self) -> int:
        return round(self.east * HOUR)

    def moved(self, command: str, told: Values, now: Values) -> Values:
        """Return the fields of a reply as the mount would tell them there; ``now`` is where it points here, and its
        local time in seconds. Raises UserError if they cannot be told."""
        local = round(self.zone * 3600) - self.seconds
        if "latitude" in told:
            told = told | {"latitude": self.latitude}
        if "longitude" in told:
            told = told | {"longitude": -self.longitude if command == "Gg" else self.longitude}
        if "az" in told or "alt" in told:
            if self.true is None or not {"az", "alt"} <= now.keys():
                raise UserError("the site is not known, so that altitudes cannot be hidden: check it again with --site")
            sky = horizon_to_hour_angle(now["az"], now["alt"], self.true)
            place = dict(zip(("az", "alt"), hour_angle_to_horizon(*sky, self.latitude), strict=True))
            told = told | {name: TICK * round(place[name] / TICK) for name in place if name in told}
        if "offset" in told:
            told = told | {"offset": told["offset"] - self.zone}
        if "unix" in told:
            told = told | {"unix": told["unix"] - self.seconds}
        if "date" in told and "time" in now:
            told = told | {"date": told["date"] + timedelta(days=(now["time"] + local) // 86400)}
        if "time" in told:  # of the day, or since 1970
            told = told | {"time": told["time"] - self.seconds if command == "GXT2" else (told["time"] + local) % 86400}
        if "hour" in told and "day" not in told:  # UTC; its date stays
            seconds = (told["hour"] * 3600 + told["minute"] * 60 + told["second"] - self.seconds) % 86400
            told = told | {"hour": seconds // 3600, "minute": seconds // 60 % 60, "second": seconds % 60}
        elif "hour" in told:
            when = datetime(2000 + told["year"], *(told[name] for name in ("month", "day", "hour", "minute", "second")))
            when += timedelta(seconds=local)
            names = ("month", "day", "hour", "minute", "second")
            told = told | {name: getattr(when, name) for name in names} | {"year": when.year - 2000}
            zone, unit = ("zone", 1) if "zone" in told else ("quarters", 4)
            told |= {zone: told[zone] + round(self.zone * unit)}
        return told


def elsewhere(site: tuple[float, float] | None, zone: float, began: float, random: Random | None = None) -> Elsewhere:
    """Choose another site for a true one, by chance; ``zone`` is local time minus UTC there, hours. The date stays."""
    latitude, longitude = site or (45.0, 0.0)
    by = random or SystemRandom()
    beyond = by.randint(-MINUTES, MINUTES) / 900.0  # hours: whoever learns the date must not learn the longitude
    today = [
        n
        for n in range(-23, 24)
        if n and len({(began + late - (n + beyond) * HOUR) // 86400 for late in (0.0, 7200.0)} | {began // 86400}) == 1
    ]
    whole = round(zone)
    allowed = [n for n in today if -180 <= longitude + 15.0 * (n + beyond) < 180 and -12 <= whole + n <= 12]
    hours = by.choice(allowed or [-1, 1])
    true, east = (latitude if site else None), hours + beyond
    there = wrap180(longitude + 15.0 * east)
    return Elsewhere(true, ROUND * round(latitude / ROUND), there, whole + hours - zone, east)


def conversation(recording: Iterable[Event], protocol: str, model: str) -> Iterator[tuple[Event, list[Heard]]]:
    """Yield each event with what it says, if it is one of the mount: a command, or the replies that it completes."""
    side = Side(protocol, model)
    for event in recording:
        said: list[Heard] = []
        if event.side == MOUNT and event.arrow == ">":
            said = [side.command_alone(event.data)]
        elif event.side == MOUNT and event.arrow == "<":
            said = list(side.replies(event.data))
        yield event, said


def site_of(recording: Recording, model: str = "") -> tuple[tuple[float, float] | None, float]:
    """Return the site that a recording tells, and the zone of its clock.

    Raises UserError if it tells two: the gateway has gone by one of them, and would show it beside the other.
    """
    config: dict[str, Any] = recording.settings["config"]["mount"]
    told: dict[str, float] = {}
    for event, said in conversation(recording, parse_endpoint(config["at"]).protocol, model):
        for heard in said if event.arrow == "<" else ():
            values: Values = dict(heard.fields)
            told |= {name: values[name] for name in ("latitude", "offset", "zone", "quarters") if name in values}
            if "longitude" in values:
                told["longitude"] = -values["longitude"] if heard.command == "Gg" else values["longitude"]
    zone = told.get("zone", told.get("quarters", -4.0 * told.get("offset", 0.0)) / 4.0)
    sites = [(one[0], one[1]) for one in [configured(recording.settings)] if one is not None]
    if {"latitude", "longitude"} <= told.keys():
        sites.insert(0, (told["latitude"], told["longitude"]))
    if len(sites) > 1 and not same_site(*sites):
        raise UserError("the mount tells another site than the settings: correct one of them, and check it again")
    return (sites[0] if sites else None), zone


def same_site(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two sites (latitude, longitude) are one that is told more or less exactly."""
    return separation(one[1], one[0], other[1], other[0]) < SAME_SITE


def configured(settings: dict[str, Any]) -> Sequence[float] | None:
    """Return the site that is written in the settings of a recording, or that a program has set in an earlier run."""
    site: Sequence[float] | None = settings["config"]["mount"].get("site")
    by_program = site_of_program(msgspec.convert(settings["past"]["kept"], SavedState))
    return site or (None if by_program is None else (by_program.latitude, by_program.longitude))
