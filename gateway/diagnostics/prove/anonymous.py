"""Makes a recording anonymous: nobody may find out from it where the mount stands, or whose it is.

Longitude and every clock are shifted together by some hours and minutes of sidereal time, so that the sky over the
mount stays as it was; the latitude is rounded to 5 degrees. Altitudes and azimuths are those of the same hour angle and
declination at that site. Only the check's own connections are kept, no name, path, address or note, and of a server's
values no text; what cannot be hidden is refused.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from random import Random, SystemRandom
from typing import Any

import msgspec
from msgspec import Struct

from gateway.app.config import MountConfig, SurfaceConfig, parse_endpoint
from gateway.app.recording.format import FORMAT, MARK, RECORDER, Event, Recording, escape
from gateway.app.state.file import SavedState, site_of_program
from gateway.app.state.store import PreviousRun
from gateway.astro.spherical import horizon_to_hour_angle, hour_angle_to_horizon, wrap180
from gateway.core import requests
from gateway.core.errors import UserError
from gateway.core.operations import Values
from gateway.core.wire_log import MOUNT, SKY_READY
from gateway.diagnostics.log.conversation import Heard, Side
from gateway.diagnostics.prove.reads import ASKS_AGAIN
from gateway.diagnostics.prove.telescope import WHO
from gateway.protocols.registry import streams
from gateway.protocols.wireformat.command_set import load

#: Seconds in which the sky turns by 15 degrees; to how many degrees a latitude is rounded.
HOUR, ROUND = 86164.0905 / 24.0, 5.0
#: Minutes of arc by which a longitude is shifted beyond whole hours, at most.
MINUTES = 420
#: The least step in which a mount tells an angle.
TICK = 360.0 / 2**24
#: Fields of commands that would tell the site, the time or a name, and questions that are left out with their answers.
PRIVATE = frozenset(
    ("latitude", "longitude", "elevation", "date", "time", "hour", "month", "year", "offset", "unix", "name", "text")
)
LEFT_OUT = ("gps", "GM", "GN", "GO", "GP", "ED", "LI")
#: Settings of a mount that a bundle keeps.
KEPT = ("baud", "mode", "equinox", "site_time", "computer_clock", "lowest", "highest", "sync_limit", "guide_rate",
        "guide_directions", "unaligned", "sun", "hour_angle_limit", "dead_man", "dead_man_closed", "run_on", "rates",
        "speed")  # fmt: skip


class Elsewhere(Struct, frozen=True):
    """Where and when a bundle says that it was: ``east`` of the true site by so many hours, and as much earlier.
    ``hours`` is that in whole time zones; ``true`` is the latitude of the true site, None if that is not known.
    """

    true: float | None
    latitude: float
    longitude: float
    hours: int
    east: float

    @property
    def seconds(self) -> int:
        return round(self.east * HOUR)

    def moved(self, command: str, told: Values, overhead: Values) -> Values:
        """Return the fields of a reply as the mount would tell them there; ``overhead`` is where it points here."""
        local = self.hours * 3600 - self.seconds
        if "latitude" in told:
            told = told | {"latitude": self.latitude}
        if "longitude" in told:
            told = told | {"longitude": -self.longitude if command == "Gg" else self.longitude}
        if "az" in told or "alt" in told:
            if self.true is None:
                raise UserError("the site is not known, so that altitudes cannot be hidden: check it again with --site")
            sky = horizon_to_hour_angle(overhead["az"], overhead["alt"], self.true)
            place = dict(zip(("az", "alt"), hour_angle_to_horizon(*sky, self.latitude), strict=True))
            told = told | {name: TICK * round(place[name] / TICK) for name in place if name in told}
        if "offset" in told:
            told = told | {"offset": told["offset"] - self.hours}
        if "unix" in told:
            told = told | {"unix": told["unix"] - self.seconds}
        if command == "GXT2":  # in seconds since 1970
            told = told | {"time": told["time"] - self.seconds}
        if command in ("GL", "Ga"):
            told = told | {"time": (told["time"] + local) % 86400}
        if "hour" in told and "day" not in told:  # UTC; its date stays
            seconds = (told["hour"] * 3600 + told["minute"] * 60 + told["second"] - self.seconds) % 86400
            told = told | {"hour": seconds // 3600, "minute": seconds // 60 % 60, "second": seconds % 60}
        elif "hour" in told:
            when = datetime(2000 + told["year"], *(told[name] for name in ("month", "day", "hour", "minute", "second")))
            when += timedelta(seconds=local)
            names = ("month", "day", "hour", "minute", "second")
            told = told | {name: getattr(when, name) for name in names} | {"year": when.year - 2000}
            zone, unit = ("zone", 1) if "zone" in told else ("quarters", 4)
            told |= {zone: told[zone] + self.hours * unit}
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
    allowed = [n for n in today if -180 <= longitude + 15.0 * (n + beyond) < 180 and -12 <= zone + n <= 12]
    hours = by.choice(allowed or [-1, 1])
    true, east = (latitude if site else None), hours + beyond
    return Elsewhere(true, ROUND * round(latitude / ROUND), wrap180(longitude + 15.0 * east), hours, east)


def _exchanges(recording: Recording, protocol: str, model: str) -> Iterator[tuple[str, Values]]:
    side = Side(protocol, model)
    for event in recording:
        if event.side == MOUNT and event.arrow == ">":
            side.command(event.data)
        elif event.side == MOUNT and event.arrow == "<":
            yield from ((heard.command, dict(heard.fields)) for heard in side.replies(event.data))


def site_of(recording: Recording, model: str = "") -> tuple[tuple[float, float] | None, float]:
    """Return the site that a recording tells, and the zone of its clock."""
    config: dict[str, Any] = recording.settings["config"]["mount"]
    told: dict[str, float] = {}
    for command, values in _exchanges(recording, parse_endpoint(config["at"]).protocol, model):
        told |= {name: values[name] for name in ("latitude", "offset", "zone", "quarters") if name in values}
        if "longitude" in values:
            told["longitude"] = -values["longitude"] if command == "Gg" else values["longitude"]
    zone = told.get("zone", told.get("quarters", -4.0 * told.get("offset", 0.0)) / 4.0)
    if {"latitude", "longitude"} <= told.keys():
        return (told["latitude"], told["longitude"]), zone
    site = _configured(recording.settings)
    return (None if site is None else (site[0], site[1])), zone


def _configured(settings: dict[str, Any]) -> Sequence[float] | None:
    """Return the site that is written in the settings of a recording, or that a program has set in an earlier run."""
    site: Sequence[float] | None = settings["config"]["mount"].get("site")
    by_program = site_of_program(msgspec.convert(settings["past"]["kept"], SavedState))
    return site or (None if by_program is None else (by_program.latitude, by_program.longitude))


def header(settings: dict[str, Any], there: Elsewhere) -> dict[str, Any]:
    """Return the settings of the anonymous recording: nothing that names a place, a computer or a file."""
    mount = settings["config"]["mount"]
    kept = {name: value for name, value in mount.items() if name.replace("-", "_") in KEPT}
    kept |= {"at": f"{str(parse_endpoint(mount['at'])).partition('@')[0]}@sim"}
    kept |= {"site": [there.latitude, there.longitude]} if _configured(settings) else {}
    surfaces = [SurfaceConfig(at=f"{parse_endpoint(one['at']).protocol}@web") for one in settings["config"]["surface"]]
    shown = {name: settings[name] for name in ("version", "commit", "rules", "python", "exchanges", "elapsed", "from")}
    shown |= {"began": settings["began"] - there.seconds, "past": PreviousRun(SavedState(1))}
    shown["config"] = {"mount": msgspec.convert(kept, MountConfig), "surface": surfaces}
    found: dict[str, Any] = msgspec.to_builtins(shown)
    return found


def anonymous(recording: Recording, there: Elsewhere, equatorial: bool, model: str) -> list[Event]:
    """Return the events of the anonymous recording. Raises UserError if something in it cannot be hidden."""
    protocol = parse_endpoint(recording.settings["config"]["mount"]["at"]).protocol
    return list(_Hiding(protocol, model, there, equatorial).events(recording))


def written(settings: dict[str, Any], events: Iterable[Event]) -> bytes:
    """Return a recording as the bytes of its file."""
    lines = [f"{MARK}{FORMAT}", f"# {json.dumps(settings)}"]
    for event in events:
        text = escape(event.data) if event.arrow in "<>" else event.data.decode("latin-1")
        lines.append(f"{event.at:.6f} {event.side} {event.arrow} {text}".rstrip(" "))
    return ("\n".join(lines) + "\n").encode("latin-1")


class _Hiding:
    def __init__(self, protocol: str, model: str, there: Elsewhere, equatorial: bool) -> None:
        self._there = there
        self._protocol, self._model = protocol, model
        #: Whether it is a server, whose values are JSON.
        self._server = protocol not in streams()
        #: Whether azimuth and altitude are the axes of an equatorial mount, which tell no more than its position does.
        self._axes = equatorial and "axes_of" in load(protocol).extra("prove.toml").get("overhead", {})
        self._side, self._commands = Side(protocol, model), load(protocol).of(model).commands
        self._overhead: Values = {}

    def events(self, recording: Recording) -> Iterator[Event]:
        last = 0.0
        for _, told in _exchanges(recording, self._protocol, self._model):  # before both are told for the first time
            self._overhead = {name: told[name] for name in ("az", "alt") if name in told} | self._overhead
        for event in recording:
            if event.data == ASKS_AGAIN.encode():
                break
            last = event.at
            if event.side == RECORDER:
                if event.arrow == "t":
                    yield event
            elif event.side == MOUNT:
                yield from self._of_mount(event)
            elif event.side.startswith("prove:") and event.arrow in "+-<>e":
                yield event
        yield Event(last, RECORDER, "!", b"ends here: the rest is left out")

    def _of_mount(self, event: Event) -> Iterator[Event]:
        match event.arrow:
            case ">":
                name = self._side.command(event.data).command
                command = self._commands.get(name)
                if command is not None and not command.question and PRIVATE & command.request.fields.keys():
                    raise UserError(f"somebody has set the mount's {command.help} meanwhile: check it again, alone")
                if name not in LEFT_OUT:
                    yield event
            case "<":
                replies = [one for one in self._side.replies(event.data) if one.command and one.command not in LEFT_OUT]
                if replies:
                    yield event._replace(data=b"".join(self._reply(one) for one in replies))
            case "k":
                yield event._replace(data=repr(float(event.data) - self._there.seconds).encode())
            case "g":
                number, _, failure = event.data.partition(b" ")
                yield event._replace(data=number + b" failed" * bool(failure))
            case "c":
                request = requests.decode(event.data.decode("latin-1"))
                if isinstance(request, requests.TellSite | requests.TellTime):
                    raise UserError("somebody has set the mount's site or time meanwhile: check it again, alone")
                if isinstance(request, requests.Base):
                    request = msgspec.structs.replace(request, who=WHO)
                yield event._replace(data=requests.encode(request).encode())
            case "l" | "w":
                yield event._replace(data=b"lost")
            case "!" if event.data == SKY_READY.encode():
                yield event
            case "b" | "s" | "q" | "d" | "o" | "h" | "u":
                yield event._replace(data=b"")

    def _reply(self, heard: Heard) -> bytes:
        """Return a reply as it would be there."""
        command, data, told = heard.command, heard.data, dict(heard.fields)
        self._overhead |= {name: told[name] for name in ("az", "alt") if name in told}
        if self._axes and "az" in told:
            return data
        if self._server and data.startswith(b'{"ErrorNumber"'):
            return _json(json.loads(data) | {"ErrorMessage": ""})
        if self._server and "value" in told:
            return _json(self._plain(command, told["value"]))
        moved = self._there.moved(command, told, self._overhead)
        if moved == told:
            return data
        forms = [form for _, form in self._commands[command].replies if form.fields.keys() == moved.keys()]
        if forms:
            hidden = [form.encode(moved) for form in forms]
            return next((one for one in hidden if len(one) == len(data)), hidden[0])
        raise UserError(f"the mount's answer to {command} cannot be hidden")

    def _plain(self, command: str, value: object) -> object:
        """Return a value of a server without any text, and the entries of its state as they would be there."""
        if command == "devicestate" and isinstance(value, list):
            state = {one["Name"]: _json(one["Value"]) for one in value if str(one["Name"]).lower() in self._commands}
            told = {name: self._commands[name.lower()].replies[0][1].decode(data) for name, data in state.items()}
            self._overhead |= {**told.get("Azimuth", {}), **told.get("Altitude", {})}
            heard = {name: Heard(data, "", name.lower(), fields=told[name]) for name, data in state.items()}
            return [{"Name": name, "Value": json.loads(self._reply(one))} for name, one in heard.items()]
        match value:
            case str():
                return ""
            case dict():
                return {key: self._plain("", one) for key, one in value.items()}
            case list():
                return [self._plain("", one) for one in value]
        return 0 if command == "siteelevation" else value


def _json(value: object) -> bytes:
    return json.dumps(value).encode() + b"\n"
